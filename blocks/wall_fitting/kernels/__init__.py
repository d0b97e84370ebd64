"""Kernels of the wall fitter for the compiled engine.

Modules and functions are named after ``contour``, ``bspline``, ``curves`` and ``offset`` of this
room, whose documentation and constants apply: ``stretch_kernel`` is the kernel of ``stretch``.
Instead of dataclasses and lists they use one array each:

* returns (m, 4): range (m), bearing (rad), x, y (m), by rising bearing;
* curves (n, 4): x, y (m) and the unit tangent, one curve after another;
* bounds (k + 1,): of k parts, part c is rows bounds[c] to bounds[c + 1].
"""
