"""How large a t must be, whatever of a declared set of distributions the numbers are drawn from.

A t-test keeps its level with normal numbers, and with groups that are alike but for their means. With few
subjects it does not where numbers are skewed and groups spread differently: of 6 and 6 exponential numbers,
the first scattering three times as much, Welch's t calls nothing a difference in 10 % of studies at 5 %, and
in 1 % at 0.1 %. Which of it holds cannot be seen in so few numbers. So a p here is the largest that any of
the set gives (the least favourable null; E. L. Lehmann, J. P. Romano, Testing Statistical Hypotheses, 2005,
3.8): SHAPES, each with every group spreading as the others or MOST_SPREAD times as much.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import product

import numpy as np
import numpy.typing as npt

from shukotsu.statistics.paired_statistics import EQUAL, Array

Singles = npt.NDArray[np.float32]

N_DRAWN = 100_000
MOST_SPREAD = 3.0
SIGNS = (1.0, -1.0, -1.0, 1.0)
"""Of the means of groups: of one, of two that are compared, and of four whose differences are."""
SHAPES = ("normal", "lognormal")


def drawn(shape: str, rng: np.random.Generator, size: tuple[int, ...]) -> Array:
    """Numbers of mean 0 and standard deviation 1: normal, or the exponentials of such (skewness 6.2)."""
    numbers = rng.standard_normal(size)
    if shape == "normal":
        return numbers
    mean = np.exp(0.5)
    return np.asarray((np.exp(numbers) - mean) / (mean * np.sqrt(np.expm1(1.0))))


@lru_cache(maxsize=256)
def largest_t_of_groups(sizes: tuple[int, ...]) -> Singles:
    """|t| of a sum and difference of group means, (N_DRAWN,) descending: at each rank that of the worst null.

    sizes : of each group. One: t of its mean; two: Welch's t; four: that of a difference of differences.
    """
    signs = np.array(SIGNS[: len(sizes)])
    spreads = [own for own in product((1.0, MOST_SPREAD), repeat=len(sizes)) if min(own) == 1.0]

    def of_nulls() -> Iterator[Array]:
        for shape in SHAPES:
            groups = [_means_and_errors(shape, group, size) for group, size in enumerate(sizes)]
            means, errors = (np.array(part) for part in zip(*groups, strict=True))
            for spread in np.array(spreads):
                yield (spread * signs) @ means / np.sqrt(spread**2 @ errors)

    return _worst(of_nulls())


@lru_cache(maxsize=32)
def _means_and_errors(shape: str, group: int, size: int) -> tuple[Array, Array]:
    """Mean and its squared standard error of so many numbers, drawn N_DRAWN times."""
    values = drawn(shape, np.random.default_rng((SHAPES.index(shape), group, size)), (N_DRAWN, size))
    return values.mean(axis=1), values.var(axis=1, ddof=1) / size


@lru_cache(maxsize=64)
def largest_t_of_slope(covariate: tuple[float, ...]) -> Singles:
    """The same of the slope over a covariate (n,): numbers spread alike, or more towards either end."""
    x = np.array(covariate)
    place = (x - x.min()) / np.ptp(x)
    spreads = [np.ones(len(x)), 1.0 + (MOST_SPREAD - 1.0) * place, MOST_SPREAD - (MOST_SPREAD - 1.0) * place]

    def of_nulls() -> Iterator[Array]:
        for number, shape in enumerate(SHAPES):
            values = drawn(shape, np.random.default_rng((len(x), number)), (N_DRAWN, len(x)))
            for spread in spreads:
                slope, error = slopes(x, (values * spread).T)
                yield slope / error

    return _worst(of_nulls())


def slopes(covariate: Array, values: Array) -> tuple[Array, Array]:
    """Slope over a covariate (n,) and its standard error, of columns (n, K) that may spread unevenly.

    The error is HC3 (J. G. MacKinnon, H. White, J. Econometrics 29, 1985).
    """
    x = covariate - covariate.mean()
    square = float(x @ x)
    slope = x @ values / square
    residual = values - values.mean(axis=0) - x[:, None] * slope
    leverage = 1.0 / len(x) + x**2 / square
    error = (x / (1.0 - leverage)) ** 2 @ residual**2
    return slope, np.sqrt(np.maximum(error, EQUAL**2)) / square


def p_of_t(t: float, largest: Singles) -> float:
    """Two-sided p of a t under the worst null, whose |t| are `largest`; the data count as one of them."""
    beyond = len(largest) - np.searchsorted(largest[::-1], abs(t) * (1.0 - EQUAL), side="left")
    return float((1 + beyond) / (1 + len(largest)))


def critical_t(p: float, largest: Singles) -> float:
    """The |t| from which `p_of_t` is at most p; infinite where so few draws have none."""
    allowed = int(p * (1 + len(largest)) + EQUAL) - 1
    return float(largest[allowed]) if allowed >= 0 else np.inf


def _worst(nulls: Iterator[Array]) -> Singles:
    worst = np.zeros(N_DRAWN, np.float32)
    for t in nulls:
        np.maximum(worst, np.sort(np.abs(t.astype(np.float32))), out=worst)
    return worst[::-1]
