"""The compiler of blocks: which methods become C, and how; below the engine, it knows no network.

A block passes through these modules in this order:

``function_source``   the text of a method, read from its file
``translate``         methods as plain functions: ``self.x`` and ``state.x`` become entries of a
                      struct, strings and flags constants; ``folding`` drops branches these decide
``fields``            the attributes of a block that its text depends on, and their types
``cache``             translations kept on disk, under everything that they depend on
``kernel``            the functions as a C unit (by ``runtime.codegen``), and how it is called

    def output(self, state, t, input):      def output(input):          # translate
        return self.gain * input                return self_gain * input

    /* codegen */
    static double output(double self_gain, double input) { return self_gain * input; }
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.compiler.cache import Records, salt
    from runtime.compiler.fields import NotCompilableError, bits_of, fixed_sizes, plain, written
    from runtime.compiler.kernel import PROJECT, Kernel, calls_of, enclosed, make_kernel, refusals
    from runtime.compiler.translate import translate_functions
else:  # Imported where something is translated: most starts find everything in the cache.
    __getattr__ = door(__name__)
