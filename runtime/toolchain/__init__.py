"""The system's C compiler: units of C text become one loaded library, kept in the user's cache.

In: translation units. Out: functions that ctypes can call::

    unit = TranslationUnit("square", "double square(double x) { return x * x; }")
    build([unit]).functions.square

``compilers`` finds the compiler, ``store`` is the cache folder, ``library`` compiles and loads.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.toolchain.compilers import (
        Compiler,
        MissingCompilerError,
        available,
        find_compiler,
        install_command,
    )
    from runtime.toolchain.library import (
        INEXACT,
        QUICK,
        THOROUGH,
        Builder,
        BuildError,
        Library,
        TranslationUnit,
        build,
        processors,
    )
    from runtime.toolchain.store import (
        VARIABLE,
        digest,
        folder,
        read,
        read_record,
        write,
        write_record,
    )
else:
    __getattr__ = door(__name__)
