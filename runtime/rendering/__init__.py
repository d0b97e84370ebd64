"""Pictures and films of a robot with physics, from its recorded states, drawn with OpenGL."""

from runtime.rendering.process import render
from runtime.rendering.request import VIEWS, RenderRequest

__all__ = ["VIEWS", "RenderRequest", "render"]
