"""Studies with and without a true difference: false positives and power."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import Cell, PrintedTable, workers
from shukotsu.arrays import Array, Bools
from shukotsu.scores.paired_statistics import LEVEL, group_difference, holm, sign_flip_p

WRITTEN_TO = "statistics.md", "tables"
STUDIES = 400
SEED = 7100


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--studies", type=int, default=STUDIES, help=f"studies per row ({STUDIES})")


def run(studies: int = STUDIES) -> Iterator[PrintedTable]:
    """Yield the tables over that many studies per row."""
    for make in (over_families, within_families):
        yield make(studies)


SIZES = ((6, 6), (5, 15), (10, 10), (20, 20))
FAMILIES = (1, 15)
MIXTURES = {
    "normal": ("normal", 1.0),
    "normal, 3 : 1": ("normal", 3.0),
    "normal, 1 : 3": ("normal", 1 / 3),
    "exponential": ("exponential", 1.0),
    "exponential, 3 : 1": ("exponential", 3.0),
    "lognormal, 3 : 1": ("lognormal", 3.0),
    "lognormal, 1 : 3": ("lognormal", 1 / 3),
    "Student 3, 3 : 1": ("student", 3.0),
}
"""Distribution of the numbers, and ratio of the first group's sd to the second's."""

SHAPES = ("normal", "exponential", "lognormal", "student")

SHIFT = 2.0
"""True difference of one number of a family, in standard deviations, for which power is stated."""


def numbers(shape: str, rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    """Draw numbers of mean 0 and standard deviation 1."""
    if shape == "exponential":
        return rng.exponential(size=size) - 1.0
    if shape == "student":
        return np.asarray(rng.standard_t(3, size) / math.sqrt(3.0))
    normal_numbers = rng.normal(size=size)
    if shape == "normal":
        return normal_numbers
    return np.asarray((np.exp(normal_numbers) - math.exp(0.5)) / math.sqrt(math.e * (math.e - 1.0)))


def correlate_columns(shape: str, rng: np.random.Generator, size: tuple[int, ...], shared: float) -> Array:
    """Draw numbers whose columns are correlated within a subject."""
    common, rest = numbers(shape, rng, (size[0], 1)), numbers(shape, rng, size)
    return np.asarray(math.sqrt(shared) * common + math.sqrt(1.0 - shared) * rest)


def any_shown(p: Sequence[float]) -> bool:
    """Return whether any test of a family is significant after Holm's correction."""
    return min(corrected for corrected in holm(p) if corrected is not None) <= LEVEL


def over_families(studies: int) -> PrintedTable:
    """Return the table of two groups: false positives and power for families of numbers."""
    return PrintedTable(
        f"Two groups, {studies} studies per number",
        ("subjects", "family:d", *(f"{name}:.1f" for name in MIXTURES), "2 sd found:.1f"),
        over_cores(_family_of_groups, [(*sizes, k, studies) for sizes in SIZES for k in FAMILIES]),
        "Percent of studies without a true difference that find one, by distribution of the numbers (3 : 1: "
        "the first group has three times the sd); numbers of a family are independent. Found: percent of "
        "studies that find a true difference of 2 standard deviations in one number (normal, equal sd).",
    )


def _family_of_groups(n: int, m: int, columns: int, studies: int) -> tuple[Cell, ...]:
    rng = np.random.default_rng((SEED, n, m, columns))

    def family(mixture: tuple[str, float], shift: Array | float) -> list[float]:
        shape, ratio = mixture
        first = ratio * numbers(shape, rng, (n, columns)) + shift
        pairs = zip(first.T, numbers(shape, rng, (m, columns)).T, strict=True)
        return [group_difference(*pair).p for pair in pairs]

    return (f"{n}, {m}", columns, *_shares(family, [*MIXTURES.values()], columns, studies))


def _shares(
    family: Callable[[Any, Array | float], list[float]], shapes: Sequence[Any], columns: int, studies: int
) -> list[Cell]:
    """Return the percent of studies with a false positive, by shape, then the power for the first shape."""
    shares: list[Cell] = [percent([any_shown(family(s, 0.0)) for _ in range(studies)]) for s in shapes]
    shift = SHIFT * (np.arange(columns) == 0)
    p = [holm(family(shapes[0], shift))[0] for _ in range(studies)]
    return [*shares, percent([value is not None and value <= LEVEL for value in p])]


def within_families(studies: int) -> PrintedTable:
    """Return the table of paired differences, in families that are independent or correlated."""
    families = [
        (n, k, r, studies) for n in (6, 8, 12, 20) for k, r in ((1, 0.0), (15, 0.0), (51, 0.0), (51, 0.5))
    ]
    return PrintedTable(
        f"The same subjects twice, families, {studies} studies per number",
        (
            "subjects:d",
            "family:d",
            "correlation:.1f",
            *(f"{shape}:.1f" for shape in SHAPES),
            "2 sd found:.1f",
        ),
        over_cores(_family_of_differences, families),
        "Percent of studies without a true difference that find one, by distribution of the differences. "
        "Found: percent of studies that find a true difference of 2 standard deviations (normal).",
    )


def _family_of_differences(n: int, columns: int, shared: float, studies: int) -> tuple[Cell, ...]:
    rng = np.random.default_rng((SEED, n, columns, round(10 * shared)))

    def family(shape: str, shift: Array | float) -> list[float]:
        return [sign_flip_p(d) for d in (correlate_columns(shape, rng, (n, columns), shared) + shift).T]

    return (n, columns, shared, *_shares(family, SHAPES, columns, studies))


def over_cores(
    row: Callable[..., tuple[Cell, ...]], asked: Sequence[tuple[object, ...]]
) -> list[tuple[Cell, ...]]:
    """Compute rows in two processes; asked : arguments of `row` for each."""
    with workers() as pool:
        return list(pool.map(row, *zip(*asked, strict=True)))


def percent(hits: Sequence[bool] | Bools) -> float:
    return 100.0 * float(np.mean(hits))
