"""Pictures and films of a robot with physics, from its recorded states, drawn with OpenGL.

Its door is the verb ``render`` (extra ``render``).
"""

from spikeblocks.mujoco.rendering.verb import EXAMPLES, GROUP, HELP, add, run
