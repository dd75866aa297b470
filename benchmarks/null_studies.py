"""Studies in which nothing differs, and some in which it does: false positives, coverage of intervals,
power.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from benchmarks.benchmark_table import Cell, TextTable
from shukotsu.statistics.curve_statistics import CurveTest, curves_between, curves_within
from shukotsu.statistics.group_statistics import permutation_p, two_groups
from shukotsu.statistics.multiple_comparisons import LEVEL, holm
from shukotsu.statistics.paired_statistics import MOST_ENUMERATED, paired
from shukotsu.statistics.reliability_statistics import bland_altman, reliability

Array = npt.NDArray[np.float64]
Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]

WRITTEN_TO = "statistics.md", "tables"
STUDIES = 2000
SEED = 7100
N_JOINTS = 20
POINTS = 101


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return rng.normal(size=shape)


def skewed(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return rng.exponential(size=shape) - 1.0


def smooth(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Curves (n, k) of unit spread, smooth over a tenth of the cycle."""
    at = np.arange(-30, 31) / 10.0
    kernel = np.exp(-(at**2) / 2)
    noise = rng.normal(size=(shape[0], shape[1] + len(kernel) - 1))
    rows = [np.convolve(row, kernel / np.sqrt((kernel**2).sum()), "valid") for row in noise]
    return np.array(rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--studies", type=int, default=STUDIES, help=f"studies a row ({STUDIES})")


def run(studies: int = STUDIES) -> Iterator[TextTable]:
    """Give the tables over that many studies a row."""
    for make in (same_subjects, two_groups_of, over_joints, over_curves, repeated):
        yield make(studies)


def same_subjects(studies: int) -> TextTable:
    """Within subjects: a test of n differences, and the interval of their mean."""
    rows: list[tuple[Cell, ...]] = []
    for n in (6, 8, 12, 20):
        for name, draw in (("normal", normal), ("exponential", skewed)):
            rng = np.random.default_rng((SEED, n))
            p, held, power = [], [], []
            for _ in range(studies):
                d = draw(rng, (n,))
                found = paired(d)
                p.append(found.p)
                held.append(found.interval is not None and found.interval[0] <= 0 <= found.interval[1])
                power.append(paired(d + 1.0).p <= LEVEL)
            exact = 100.0 * math.floor(LEVEL * 2 ** (n - 1)) / 2 ** (n - 1) if n <= MOST_ENUMERATED else 5.0
            shown = percent(power) if draw is normal else None
            rows.append((n, name, percent(np.array(p) <= LEVEL), exact, percent(held), shown))
    return TextTable(
        f"The same subjects twice, {studies} studies a row",
        ("subjects:d", "differences", "false positives, %:.1f", "possible, %:.1f", "interval holds, %:.1f",
         "power, %:.1f"),
        rows,
        "Sign flips. Possible: the largest share up to 5 % that a test of every flip can have. It takes "
        "symmetric differences for granted, which exponential ones are not. Power: of an effect of one "
        "standard deviation of the differences.",
    )  # fmt: skip


def two_groups_of(studies: int) -> TextTable:
    """Between groups: false positives of the permutation test and coverage of Welch's interval."""
    rows: list[tuple[Cell, ...]] = []
    for n, m in ((4, 4), (5, 5), (6, 6), (5, 15), (8, 12), (10, 10), (20, 20)):
        for name, draw, ratio in (
            ("normal", normal, 1.0),
            ("exponential", skewed, 1.0),
            ("spread 3 : 1", normal, 3.0),
        ):
            rng = np.random.default_rng((SEED, n, m))
            counts = np.zeros((studies, 3), bool)
            for study in range(studies):
                a, b = ratio * draw(rng, (n,)), draw(rng, (m,))
                found = two_groups(a, b)
                assert found.p is not None
                assert found.interval is not None
                shift = 1.5 * math.sqrt((ratio**2 + 1) / 2)
                counts[study] = (
                    found.p <= LEVEL,
                    found.interval[0] <= 0 <= found.interval[1],
                    permutation_p(a + shift, b) <= LEVEL,
                )
            rows.append((f"{n}, {m}", name, *(percent(column) for column in counts.T)))
    return TextTable(
        f"Two groups, {studies} studies a row",
        (
            "subjects",
            "values",
            "false positives, %:.1f",
            "interval holds, %:.1f",
            "power, %:.1f",
        ),
        rows,
        "Subjects who change groups, Welch's t; Welch's interval. Spread 3 : 1: the first group scatters "
        "three times as much. Power: of an effect of 1.5 standard deviations (root mean square of both).",
    )


def over_joints(studies: int) -> TextTable:
    """Many joints at once: how often any is called different, as they are and corrected."""
    rows: list[tuple[Cell, ...]] = []
    for design, shared in (("within, 12", 0.0), ("within, 12", 0.5), ("between, 6 and 6", 0.0)):
        rng = np.random.default_rng((SEED, round(10 * shared), len(design)))
        groups = (12, 0) if design.startswith("within") else (6, 6)
        counts = []
        for _ in range(studies):
            common = math.sqrt(shared) * rng.normal(size=(12, 1))
            values = common + math.sqrt(1 - shared) * rng.normal(size=(12, N_JOINTS))
            p = _p_of_joints(values, design)
            wrong = min(p) <= LEVEL, _any_shown(p), bool(_curve_test(values, *groups).significant.any())
            values[:, 0] += 1.5 if design.startswith("within") else 3.0 * (np.arange(12) < 6)
            shown = _first_shown(_p_of_joints(values, design)), _curve_test(values, *groups).significant[0]
            counts.append((*wrong, *shown))
        rows.append((design, shared, *map(percent, zip(*counts, strict=True))))
    return TextTable(
        f"{N_JOINTS} joints, {studies} studies a row",
        (
            "subjects",
            "correlation:.1f",
            "any p below 5 %, %:.1f",
            "any Holm-corrected, %:.1f",
            "any by the largest t, %:.1f",
            "power, Holm, %:.1f",
            "power, largest t, %:.1f",
        ),
        rows,
        "Nothing differs; then one joint does, by 1.5 standard deviations of the differences, or 3 of the "
        "groups, and is found after correction.",
    )


def _p_of_joints(values: Array, design: str) -> list[float]:
    if design.startswith("within"):
        return [paired(column).p for column in values.T]
    return [permutation_p(column[:6], column[6:]) for column in values.T]


def _any_shown(p: Sequence[float]) -> bool:
    return any(one is not None and one <= LEVEL for one in holm(p))


def _first_shown(p: Sequence[float]) -> bool:
    first = holm(p)[0]
    return first is not None and first <= LEVEL


def over_curves(studies: int) -> TextTable:
    """Curves: how often any point is called different, and what share of points a band holds."""
    rows: list[tuple[Cell, ...]] = []
    bump = np.exp(-(((np.arange(POINTS) - 50) / 10.0) ** 2))
    for design, n, m, missing in (
        ("within", 8, 0, False), ("within", 12, 0, False), ("within", 12, 0, True),
        ("between", 6, 6, False), ("between", 6, 8, True),
    ):  # fmt: skip
        rng = np.random.default_rng((SEED, n, m, missing))
        wrong, held, found = [], [], []
        for _ in range(studies):
            curves = smooth(rng, (n + m, POINTS))
            if missing:  # every third subject lacks a stretch
                for row in range(0, n + m, 3):
                    start = rng.integers(0, POINTS - 30)
                    curves[row, start : start + 30] = np.nan
            null = _curve_test(curves, n, m)
            wrong.append(bool(null.significant.any()))
            known = np.isfinite(null.low)
            held.append(((null.low <= 0) & (null.high >= 0))[known].mean())
            curves[:n] += (1.5 if m == 0 else 2.5) * bump
            found.append(bool(_curve_test(curves, n, m).significant[45:56].any()))
        subjects = f"{design}, {n}" + (f" and {m}" if m else "")
        rows.append(
            (subjects, "yes" if missing else "no", percent(wrong), 100 * np.mean(held), percent(found))
        )
    return TextTable(
        f"Curves of {POINTS} points, {studies} studies a row",
        (
            "subjects",
            "stretches missing",
            "any point wrong, %:.1f",
            "band holds, % of points:.1f",
            "power, %:.1f",
        ),
        rows,
        "Smooth over a tenth of the cycle. Any point wrong: false positives of the whole curve. Bands are "
        "pointwise. Power: of a bump of 1.5 standard deviations of the differences, or 2.5 of the groups.",
    )


def _curve_test(curves: Array, n: int, m: int) -> CurveTest:
    found = curves_between(curves[:n], curves[n:]) if m else curves_within(curves)
    assert found is not None
    return found


def repeated(studies: int) -> TextTable:
    """Repeated measurements: what share of the intervals holds the ICC, the SEM and a limit of agreement."""
    rows: list[tuple[Cell, ...]] = []
    for n, k, of_subjects, of_sessions in (
        (12, 3, 2.0, 0.0),
        (12, 3, 2.0, 0.5),
        (12, 2, 1.0, 0.0),
        (20, 3, 3.0, 0.0),
    ):
        rng = np.random.default_rng((SEED, n, k))
        within = 1.0 + of_sessions**2
        agreement, consistency = (
            of_subjects**2 / (of_subjects**2 + within),
            of_subjects**2 / (of_subjects**2 + 1),
        )
        counts, sem = np.zeros((studies, 4), bool), []
        for study in range(studies):
            values = of_subjects * rng.normal(size=(n, 1)) + rng.normal(size=(n, k))
            values = values + of_sessions * rng.normal(size=k)
            found, limits = reliability(values), bland_altman(values)
            sem.append(found.sem)
            intervals = (
                (found.agreement.interval, agreement), (found.consistency.interval, consistency),
                (found.sem_interval, math.sqrt(within)), (limits.high_interval, 1.96 * math.sqrt(2.0)),
            )  # fmt: skip
            counts[study] = [low <= true <= high for (low, high), true in intervals]
        held: list[Cell] = [percent(column) for column in counts.T]
        if of_sessions:
            held[3] = None  # the limits are of these sessions
        rows.append((f"{n} x {k}", of_sessions, agreement, *held, float(np.mean(sem) / math.sqrt(within))))
    return TextTable(
        f"Repeated measurements, {studies} studies a row",
        ("subjects x sessions", "spread of sessions:.1f", "ICC(2,1):.2f", "its interval holds, %:.1f",
         "of ICC(3,1), %:.1f", "of SEM, %:.1f", "of a limit, %:.1f", "mean SEM over true:.2f"),
        rows,
        "Errors have a standard deviation of 1. Spread of sessions: of a shift that all subjects share in a "
        "session. With few sessions no interval knows such a shift well.",
    )  # fmt: skip


def percent(hits: Sequence[bool] | npt.NDArray[np.bool_]) -> float:
    return 100.0 * float(np.mean(hits))
