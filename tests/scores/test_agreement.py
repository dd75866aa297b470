"""The expected difference of two estimates of a bone length, against simulated people and noise."""

import numpy as np
import pytest

from shukotsu.fit.fit import SIDE_SD
from shukotsu.scores.agreement import Estimate, compare_pairs, difference_sd_mm, times_expected

N_DRAWN = 40_000
GROUPS = ("length", "scale", "slide x", "mount")
RNG = np.random.default_rng(5)
ROW = np.array([1.4, 0.8, 0.0, 0.0])
DATA = RNG.normal(size=(3, 4)), 1.7 * RNG.normal(size=(2, 4))
"""Design matrices of two recordings for four unknowns, in units of the noise."""


def estimate(data: np.ndarray, session: str, hand: str, *recordings: str, whole: bool = True) -> Estimate:
    covariance = np.linalg.inv(data.T @ data + np.eye(4))
    sd_mm = float(np.sqrt(ROW @ covariance @ ROW))
    pulls = {(group, group): float(mm) for group, mm in zip(GROUPS, ROW @ covariance, strict=True)}
    return Estimate(session, hand, frozenset(recordings), whole, 40.0, sd_mm, pulls)


def simulated_difference_mm(n_same: int) -> float:
    """Return the sd of the difference between two fits of simulated people; n_same : number of shared
    unknowns.
    """
    x = RNG.normal(size=(2, N_DRAWN, 4))
    x[1, :, :n_same] = x[0, :, :n_same]
    fitted = []
    for data, person in zip(DATA, x, strict=True):
        seen = person @ data.T + RNG.normal(size=(N_DRAWN, len(data)))
        fitted.append(seen @ data @ np.linalg.inv(data.T @ data + np.eye(4)) @ ROW)
    return float(np.std(fitted[1] - fitted[0]))


@pytest.mark.parametrize(("across", "n_same"), [("recording", 4), ("session", 3), ("hand", 2)])
def test_the_expected_difference_is_that_of_simulated_estimates(across: str, n_same: int) -> None:
    first, second = (estimate(data, "1", "right") for data in DATA)
    side_mm = SIDE_SD * 40.0 if across == "hand" else 0.0
    expected = np.hypot(simulated_difference_mm(n_same), side_mm)
    assert difference_sd_mm(first, second, across) == pytest.approx(expected, rel=0.02)


def test_only_estimates_that_differ_in_one_respect_are_compared() -> None:
    """Pairs differ in session, hand or recording; not in several of these, nor is a hand compared with
    itself.
    """
    data = DATA[0]
    estimates = [
        estimate(data, "1", "right", "rom", "grasp"),
        estimate(data, "1", "right", "rom", whole=False),
        estimate(data, "1", "right", "grasp", whole=False),
        estimate(data, "1", "left", "rom"),
        estimate(data, "2", "right", "rom"),
    ]
    rows = list(compare_pairs(estimates))
    assert [tuple(row[c] for c in ("across", "session", "hand", "first", "second")) for row in rows] == [
        ("hand", "1", "", "right", "left"),
        ("session", "", "right", "1", "2"),
        ("recording", "1", "right", "rom", "grasp"),
    ]
    assert times_expected([{"across": "hand", "z": z} for z in (3.0, -4.0)]) == {
        "hand": (pytest.approx(np.sqrt(12.5)), 2)
    }
