"""Pictures and films of a robot with physics, from its recorded states, drawn with OpenGL."""

from runtime.rendering.process import VIEWS, RenderRequest, render

__all__ = ["VIEWS", "RenderRequest", "render"]
