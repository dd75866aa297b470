"""The stages' scripts, which nothing imports, as tests run them in their own process."""

from __future__ import annotations

import runpy
from collections.abc import Callable, Sequence
from functools import cache
from types import SimpleNamespace

from program_files import REPOSITORY


@cache
def stage_script(name: str) -> SimpleNamespace:
    """Return what stands in the script of a stage."""
    return SimpleNamespace(**runpy.run_path(str(REPOSITORY / "stages" / f"{name}.py")))


def stage_main(name: str) -> Callable[[Sequence[str]], int]:
    """Return the function that takes the arguments of a stage's script and returns its exit code."""
    main: Callable[[Sequence[str]], int] = stage_script(name).main
    return main
