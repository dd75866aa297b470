"""Command line: compile the functions that fit and pose hands ahead of time, so that no study waits for it.

On paper: docs/whole-hand.md, section 6.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from shukotsu.fit import compiled_equations
from shukotsu.fit.chain import hand_model
from shukotsu.fit.fit import problem_of
from shukotsu.fit.kernel.compiled import folders
from shukotsu.fit.normal_equations import Frames, Observations, Point, Problem
from shukotsu.study.layout import read_layout

LAYOUT = "liberty16"


def compile_all() -> None:
    """Compile every function by calling it; numba caches them beside the code, or in NUMBA_CACHE_DIR."""
    problem, point = one_frame()
    steps = compiled_equations.reduce(problem, point)
    compiled_equations.back_substitute(problem, point, steps, np.zeros(len(point.x)))
    compiled_equations.pose(problem, point)


def load_compiled() -> None:
    """Load the functions for forks of this process to share, but only if all are compiled already."""
    if all(folder and any(folder.glob(f"{name}-*.nbi")) for name, folder in folders.items()):
        compile_all()


def one_frame() -> tuple[Problem, Point]:
    """Return the problem and the point of a flat average hand in a frame without valid receivers."""
    layout = read_layout(LAYOUT)
    names = [name for name in layout.measured if not layout.segments[name].optional]
    model = hand_model(layout, names, names, np.zeros(3))
    n_unknowns, n_receivers = len(model.unknowns.names), len(names)
    turns, valid = np.tile(np.eye(3), (1, n_receivers, 1, 1)), np.zeros((1, n_receivers), bool)
    unseen = Frames(turns, np.zeros((1, n_receivers, 3)), valid)
    problem = problem_of(model, unseen, Observations.of([], [], n_unknowns))
    y, root = problem.state_mean[None].copy(), np.eye(3)[None].copy()
    return problem, Point(np.zeros(n_unknowns), y, root, np.zeros((1, 3)))


@contextmanager
def held_kernel(*, alone: bool) -> Iterator[None]:
    """Lock the kernel, exclusively (`alone`) to compile it while other processes wait, otherwise shared.

    If files cannot be locked, every process compiles for itself.
    """
    with Path(__file__).with_name("kernel").joinpath("__init__.py").open("rb") as file:
        with suppress(ImportError, OSError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        yield


if __name__ == "__main__":
    with held_kernel(alone=True):
        compile_all()
