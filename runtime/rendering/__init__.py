"""Pictures and films of a robot with physics, from the states that its run recorded."""
