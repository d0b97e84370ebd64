"""Pictures and films of a robot with physics, from its recorded states, drawn with OpenGL.

A bridge: its door is the verb ``render``, and nothing but the table of verbs names it.
"""

from runtime.rendering.verb import EXAMPLES, GROUP, HELP, add, run
