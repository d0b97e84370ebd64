"""The compiled engine: the plan and the blocks that it calls as C, compiled and loaded.

``kernels`` has every block as a C unit (from ``runtime.compiler``), ``c_plan`` prints the
plan that calls them, ``memory`` is what both languages share, ``runner`` runs it for the engine.
"""

from runtime.engine.compiled.c_plan import PlanText, c_plan
from runtime.engine.compiled.kernels import make_kernels
from runtime.engine.compiled.runner import CheckedRunner, CompiledRunner
from runtime.engine.compiled.signals import Ending
