"""Units of C become one loaded library; what is in the cache is not compiled again."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from runtime import toolchain
from runtime.toolchain import BuildError, Library, TranslationUnit, build, library, store

SQUARE = TranslationUnit("square", "double square(double x) { return x * x; }\n")
ROOT = TranslationUnit("root", "#include <math.h>\ndouble root(double x) { return sqrt(x); }\n")
PLAN = TranslationUnit(
    "plan",
    "double square(double x);\ndouble root(double x);\n"
    "double plan(double x) { return root(square(x) + 1.0); }\n",
)
UNITS = (SQUARE, ROOT, PLAN)
PROGRAM = f"""
from runtime.toolchain import TranslationUnit, build
units = [TranslationUnit(*pair) for pair in {[(unit.name, unit.text) for unit in UNITS]}]
from tests.runtime.toolchain.test_library import value
print(value(build(units), "plan", 3.0))
"""


def value(made: Library, name: str, *arguments: float) -> float:
    function = getattr(made.functions, name)
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * len(arguments)
    found: float = function(*arguments)
    return found


def files(cache: Path) -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in cache.iterdir()}


@pytest.mark.usefixtures("compiler")
def test_units_call_each_other() -> None:
    made = build(UNITS)
    assert value(made, "plan", 3.0) == math.sqrt(10.0)
    assert made.compiled == ("plan", "root", "square")


@pytest.mark.usefixtures("compiler")
def test_scalar_arithmetic_is_pythons_to_the_bit() -> None:
    text = (
        "#include <math.h>\n"
        "double f(double a, double b, double c)\n"
        "{ return a * b + c - expm1(a) * sin(b) / cos(c); }\n"
    )
    made = build([TranslationUnit("f", text)])
    for i in range(1, 200):
        a, b, c = 0.1 * i, 1.0 / i, -0.01 * i
        expected = a * b + c - math.expm1(a) * math.sin(b) / math.cos(c)
        assert value(made, "f", a, b, c) == expected


def test_a_library_in_the_cache_starts_no_process(
    cache: Path, compiler: toolchain.Compiler, monkeypatch: pytest.MonkeyPatch
) -> None:
    build(UNITS)
    before = files(cache)
    assert not [path for path in before if path.is_dir()]
    monkeypatch.setattr(subprocess, "run", None)
    toolchain.compilers._find.cache_clear()
    made = build(UNITS)
    assert made.compiled == () and value(made, "plan", 3.0) == math.sqrt(10.0)
    assert files(cache) == before
    assert toolchain.find_compiler() == compiler


@pytest.mark.skipif(shutil.which("clang") is None, reason="no clang")
def test_clang_takes_the_same_text_with_its_own_options(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "clang")
    assert value(build(UNITS), "plan", 3.0) == math.sqrt(10.0)


CLIPPED = """
#include <stdint.h>
#include <stdlib.h>
static inline double np_clip(double x, double low, double high)
{
    double found = x >= low || x != x ? x : low;
    return found <= high || found != found ? found : high;
}
void chosen(const double *x, double high, double other, double *b, double *out)
{
    int64_t *z = malloc(48);
    for (int64_t i = 0; i < 2; i++) for (int64_t j = 0; j < 3; j++) z[3*i+j] = 0;
    for (int64_t i = 0; i < 2; i++) for (int64_t j = 0; j < 3; j++)
        b[3*i+j] = (double)z[3*i+j] + 2.5;
    for (int64_t i = 0; i < 2; i++) for (int64_t j = 0; j < 3; j++)
        out[3*i+j] = (np_clip(x[3*i+j], 0.0, high) > 0.0) ? b[3*i+j] : other;
    free(z);
}
"""


@pytest.mark.usefixtures("compiler")
def test_a_loop_that_gcc_computes_wrongly_at_o3() -> None:
    # np.where(np.clip(x, 0, 0.5625) > 0, 2.5, 6.75): gcc 12.2 at -O3 gives 0 for x[3].
    x, b, out = ((ctypes.c_double * 6)(*values) for values in ((1, -0.5, 2, 3, 0.25, -1), (), ()))
    function = build([TranslationUnit("chosen", CLIPPED)]).functions.chosen
    function.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, *[ctypes.c_void_p] * 2]
    function(x, 0.5625, 6.75, b, out)
    assert list(out) == [2.5, 6.75, 2.5, 2.5, 2.5, 6.75]


@pytest.mark.usefixtures("compiler")
def test_another_plan_compiles_one_unit() -> None:
    build(UNITS)
    other = TranslationUnit(
        "plan", "double square(double x);\ndouble plan(double x) { return -square(x); }\n"
    )
    said: list[tuple[str, ...]] = []
    made = build([SQUARE, ROOT, other], note=said.append)
    assert made.compiled == ("plan",) and said == [("plan",)]
    assert value(made, "plan", 3.0) == -9.0


@pytest.mark.usefixtures("compiler")
def test_units_of_one_text_are_linked_once() -> None:
    assert value(build([SQUARE, TranslationUnit("again", SQUARE.text)]), "square", 3.0) == 9.0


@pytest.mark.usefixtures("compiler")
def test_a_checked_build_is_another_library() -> None:
    text = "#ifdef SPIKEBLOCKS_CHECKED\nint checked(void) { return 1; }\n#else\n"
    unit = TranslationUnit("checked", text + "int checked(void) { return 0; }\n#endif\n")
    assert build([unit]).functions.checked() == 0
    assert build([unit], checked=True).functions.checked() == 1


@pytest.mark.usefixtures("compiler")
def test_a_unit_that_is_not_c_is_reported_with_its_name_and_line() -> None:
    with pytest.raises(BuildError, match="'bad/../name'") as caught:
        build([SQUARE, TranslationUnit("bad/../name", "int f(void)\n{ return x; }\n")])
    assert caught.value.unit == "bad/../name" and caught.value.exit_code == 4
    assert "name.c:2:" in caught.value.output


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("text", ["int here(void);\nint f(void) { return here(); }\n"])
def test_a_function_that_nobody_defines_is_an_error(text: str) -> None:
    with pytest.raises(BuildError):
        build([TranslationUnit("open", text)])


def other(file: Path, content: bytes) -> None:
    """Another file of that name: the old one may be a loaded library."""
    file.unlink()
    file.write_bytes(content)


def entries(cache: Path) -> dict[Path, bytes]:
    """The files of the cache with their content, without the time of the last walk."""
    return {path: path.read_bytes() for path in cache.iterdir() if path.name != store.WALKED}


DAMAGES: dict[str, Callable[[Path, bytes], object]] = {
    "truncated": lambda file, old: other(file, old[: len(old) // 2]),
    "garbled": lambda file, old: other(file, bytes(255 - byte for byte in old)),
    "flipped": lambda file, old: other(file, old[:-9] + bytes([old[-9] ^ 1]) + old[-8:]),
    "emptied": lambda file, old: other(file, b""),
    "removed": lambda file, old: file.unlink(),
    "a folder": lambda file, old: (file.unlink(), file.mkdir()),
}


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("kind", DAMAGES)
def test_damaged_files_are_made_again(kind: str, cache: Path) -> None:
    build(UNITS)
    whole = entries(cache)
    assert {path.suffix for path in whole} == {".o", library.LIBRARY, ".json", ".sha256"}
    for suffix in ("", ".sha256"):
        # All at once: the library is linked from the objects, which are compiled again.
        for path in whole:
            if path.name.endswith(suffix):
                DAMAGES[kind](path, path.read_bytes())
        toolchain.compilers._find.cache_clear()
        assert value(build(UNITS), "plan", 3.0) == math.sqrt(10.0)
        assert entries(cache).keys() == whole.keys()


@pytest.mark.usefixtures("compiler")
def test_processes_at_once_on_an_empty_cache(cache: Path) -> None:
    command = [sys.executable, "-c", PROGRAM]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    for process in running:
        answer, _ = process.communicate()
        assert process.returncode == 0 and float(answer) == math.sqrt(10.0)
    assert not [path for path in cache.iterdir() if ".build" in path.name]
    assert build(UNITS).compiled == ()


@pytest.mark.usefixtures("compiler")
def test_a_build_that_fails_leaves_nothing(cache: Path) -> None:
    with pytest.raises(BuildError):
        build([TranslationUnit("bad", "int")] * 2 + [TranslationUnit("worse", "}")])
    assert {path.name.partition("_")[0] for path in cache.iterdir()} <= {"compiler"}
