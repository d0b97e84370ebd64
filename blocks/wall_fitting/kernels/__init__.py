"""What the compiled engine takes in place of numpy and scipy, where it fills a module: loops.

The modules and their functions are named after ``contour``, ``bspline``, ``curves`` and ``offset``
of this room, whose documentation and constants hold here: ``stretch_kernel`` does what ``stretch``
does. Where those keep dataclasses and lists, these keep one array for all of it:

* returns (m, 4): range (m), bearing (rad), x, y (m), by rising bearing;
* curves (n, 4): x, y (m) and the unit tangent, one curve after another;
* bounds (k + 1,): of k parts, part c is rows bounds[c] to bounds[c + 1].
"""
