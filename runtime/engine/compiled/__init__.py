"""The compiled engine: the plan's function and the blocks that it calls, compiled with numba.

``translate`` writes a block's methods as plain functions, ``emit`` the plan that calls them,
``cache`` keeps both on disk, and ``runner`` runs them for the engine.
"""

from runtime.engine.compiled.runner import CompiledRunner

__all__ = ["CompiledRunner"]
