"""Studies with and without a true difference: false positives and power."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.benchmark_table import Cell, PrintedTable, Row, in_two_processes, percent
from shukotsu.arrays import Array
from shukotsu.scores.paired_statistics import LEVEL, group_difference, holm, sign_flip_p

WRITTEN_TO = "statistics.md", "tables"
STUDIES = 400
"""Number of studies per row."""
SEED = 7100

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

LOGNORMAL_SD = math.sqrt(math.e * (math.e - 1.0))
SHAPES: Mapping[str, Callable[[np.random.Generator, tuple[int, ...]], Array]] = {
    "normal": lambda rng, size: rng.normal(size=size),
    "exponential": lambda rng, size: rng.exponential(size=size) - 1.0,
    "lognormal": lambda rng, size: (np.exp(rng.normal(size=size)) - math.exp(0.5)) / LOGNORMAL_SD,
    "student": lambda rng, size: rng.standard_t(3, size) / math.sqrt(3.0),
}
"""Functions that draw numbers of mean 0 and standard deviation 1, by distribution."""

SHIFT = 2.0
"""True difference of one number of a family, in standard deviations, for which power is stated."""


def any_shown(p: Sequence[float]) -> bool:
    """Return whether any test of a family is significant after Holm's correction."""
    return min(corrected for corrected in holm(p) if corrected is not None) <= LEVEL


def run() -> Iterator[PrintedTable]:
    """Yield the tables of two groups and of paired differences: false positives and power of families."""
    groups = [(*sizes, k) for sizes in SIZES for k in FAMILIES]
    yield PrintedTable(
        f"Two groups, {STUDIES} studies per number",
        ("subjects", "family:d", *(f"{name}:.1f" for name in MIXTURES), "2 sd found:.1f"),
        in_two_processes(_family_of_groups, *zip(*groups, strict=True)),
        "Percent of studies without a true difference that find one, by distribution of the numbers (3 : 1: "
        "the first group has three times the sd); numbers of a family are independent. Found: percent of "
        "studies that find a true difference of 2 standard deviations in one number (normal, equal sd).",
    )
    families = [(n, k, r) for n in (6, 8, 12, 20) for k, r in ((1, 0.0), (15, 0.0), (51, 0.0), (51, 0.5))]
    shapes = [f"{shape}:.1f" for shape in SHAPES]
    yield PrintedTable(
        f"The same subjects twice, families, {STUDIES} studies per number",
        ("subjects:d", "family:d", "correlation:.1f", *shapes, "2 sd found:.1f"),
        in_two_processes(_family_of_differences, *zip(*families, strict=True)),
        "Percent of studies without a true difference that find one, by distribution of the differences. "
        "Found: percent of studies that find a true difference of 2 standard deviations (normal).",
    )


def _family_of_groups(n: int, m: int, columns: int) -> Row:
    rng = np.random.default_rng((SEED, n, m, columns))

    def family(mixture: tuple[str, float], shift: Array | float) -> list[float]:
        shape, ratio = mixture
        first = ratio * SHAPES[shape](rng, (n, columns)) + shift
        pairs = zip(first.T, SHAPES[shape](rng, (m, columns)).T, strict=True)
        return [group_difference(*pair).p for pair in pairs]

    return (f"{n}, {m}", columns, *_shares(family, [*MIXTURES.values()], columns))


def _shares(
    family: Callable[[Any, Array | float], list[float]], shapes: Sequence[Any], columns: int
) -> list[Cell]:
    """Return the percent of studies with a false positive, by shape, then the power for the first shape."""
    shares: list[Cell] = [percent([any_shown(family(s, 0.0)) for _ in range(STUDIES)]) for s in shapes]
    shift = SHIFT * (np.arange(columns) == 0)
    p = [holm(family(shapes[0], shift))[0] for _ in range(STUDIES)]
    return [*shares, percent([value is not None and value <= LEVEL for value in p])]


def _family_of_differences(n: int, columns: int, shared: float) -> Row:
    """Compute the row of a family of differences that are correlated within a subject."""
    rng = np.random.default_rng((SEED, n, columns, round(10 * shared)))

    def family(shape: str, shift: Array | float) -> list[float]:
        common, rest = SHAPES[shape](rng, (n, 1)), SHAPES[shape](rng, (n, columns))
        differences = math.sqrt(shared) * common + math.sqrt(1.0 - shared) * rest + shift
        return [sign_flip_p(d) for d in differences.T]

    return (n, columns, shared, *_shares(family, [*SHAPES], columns))
