"""Decorators that compile loops over frames, and small loops that the other modules of the kernel share.

Numba caches compiled code on disk until the file of the function changes. As a function may call functions in
another file of the kernel, the name under which it is cached ends in a digest of all these files.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

from shukotsu.arrays import Array

Function = TypeVar("Function", bound=Callable[..., Any])

_FILES = sorted(Path(__file__).parent.glob("*.py"))
_DIGEST = hashlib.sha256(b"".join(path.read_bytes() for path in _FILES)).hexdigest()[:12]

folders: dict[str, Path | None] = {}
"""Folders in which functions' machine code is cached, by the beginning of the cache file's name; None if it
cannot be cached.
"""


def compiled(function: Function, signature: str | None = None) -> Function:
    """Compile on the first call, or at once for a signature; cache the machine code on disk if possible.

    Code of an older kernel is removed from the cache, as loading it would crash the process if it refers to
    types that no longer exist.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    stem, name = Path(function.__code__.co_filename).stem, function.__name__
    function.__qualname__ = f"{name}_{_DIGEST}"
    cached = f"{stem}.{function.__qualname__}"
    folders.setdefault(cached)
    try:
        folder = folders[cached] = Path(numba.njit(cache=True, **options)(function).stats.cache_path)
        for index in folder.glob(f"{stem}.{name}_{'?' * len(_DIGEST)}-*.nbi"):
            if not index.name.startswith(f"{cached}-"):
                with suppress(OSError):  # another process may have removed it already
                    index.unlink()
        return cast(Function, numba.njit(signature, cache=True, **options)(function))
    except RuntimeError:  # neither this folder nor the user's cache is writable
        return cast(Function, numba.njit(signature, **options)(function))


def inner(function: Function) -> Function:
    """Compile a function that is called only by compiled functions, whose machine code then includes it."""
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(Function, numba.njit(**options)(function))


def inlined(function: Function) -> Function:
    """Compile a function by inlining it into each caller."""
    return cast(Function, numba.njit(inline="always", error_model="numpy")(function))


@inner
def copy(values: Array, out: Array) -> None:
    """Copy an array element by element.

    Parameters
    ----------
    values : array, shape (n, F)
        Source.
    out : array, shape (n, F)
        Output.

    """
    for i in range(len(out)):
        for f in range(out.shape[1]):
            out[i, f] = values[i, f]


@inner
def copy_matrices(values: Array, out: Array) -> None:
    """Copy an array of matrices element by element.

    Parameters
    ----------
    values : array, shape (n, m, F)
        Source.
    out : array, shape (n, m, F)
        Output.

    """
    for i in range(len(out)):
        copy(values[i], out[i])


def fill(value: float, out: Array) -> None:
    """Set all elements of an array.

    Parameters
    ----------
    value : float
        Value.
    out : array, shape (n, F)
        Output.

    """
    for i in range(len(out)):
        for f in range(out.shape[1]):
            out[i, f] = value


# Compiled at import: what numba loads for it (half a second) is then shared by all forks of the warm process.
fill = compiled(fill, "void(float64, float64[:, ::1])")
