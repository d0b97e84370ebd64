"""Pictures and films of a robot with physics, from the states that its run recorded."""

from runtime.rendering.process import render
from runtime.rendering.request import VIEWS, RenderRequest

__all__ = ["VIEWS", "RenderRequest", "render"]
