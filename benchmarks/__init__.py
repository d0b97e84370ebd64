"""Speed, side by side with what one would use instead: ``python -m benchmarks``."""

import os

# All contestants get one core: numpy's linear algebra takes its number of threads when imported.
for _library in ("OMP", "OPENBLAS", "MKL", "BLIS"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
