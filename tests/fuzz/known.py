"""Faults that are known and not repaired yet: each name keeps a fuzzer away from one of them.

Take a name out, with the lines that ask for it, as soon as its fault is repaired.
"""

from __future__ import annotations

# Names and texts reach the terminal with their control characters.
CONTROLS = True
# --json prints Infinity where a LiDAR misses.
INFINITY = True
# Names that are too long or not UTF-8 end in tracebacks.
BAD_NAMES = True
# Links in a folder that is read are followed out of it.
LINKS = True
# A kernel stands for a method that a subclass overrides.
KERNELS = True
# A compile cache with other damages than missing files ends the run.
CACHES = True
