"""The compiled engine: the plan and the blocks that it calls as C, compiled and loaded.

``translate`` writes the methods of blocks as functions, ``kernels`` these as C units, ``emit`` the
plan that calls them, ``memory`` what both languages share, and ``runner`` runs it for the engine.
"""

from runtime.engine.compiled.entries import fixed_sizes
from runtime.engine.compiled.kernels import Kernel, make_kernels, refusals
from runtime.engine.compiled.runner import CheckedRunner, CompiledRunner

__all__ = ["CheckedRunner", "CompiledRunner", "Kernel", "fixed_sizes", "make_kernels", "refusals"]
