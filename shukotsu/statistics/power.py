"""Tell how often studies of given sizes would show a true difference: by simulation, with the
test of `verdicts`.
"""

from __future__ import annotations

import math

import numpy as np

from shukotsu.statistics.least_favourable import SIGNS, critical_t, largest_t_of_groups
from shukotsu.statistics.multiple_comparisons import LEVEL

N_STUDIES = 20_000


def spread_of_means(subject_sd: float, session_sd: float, seen: float, n_sessions: int) -> float:
    """Spread of subjects' means of n sessions, told by that of means of the `seen` sessions.

    session_sd : the part that one session has in it.
    """
    lasting = max(0.0, subject_sd**2 - session_sd**2 / seen)
    return math.sqrt(lasting + session_sd**2 / n_sessions)


def power(n_groups: int, spread: float, difference: float, n: int, among: int = 1) -> float:
    """Share of studies that show a difference, with n subjects in each group (one: within subjects).

    spread : standard deviation of normal numbers in each. among : questions that are asked together.
    """
    rng = np.random.default_rng((n, n_groups))
    means = rng.standard_normal((n_groups, N_STUDIES)) / math.sqrt(n)
    errors = rng.chisquare(n - 1, (n_groups, N_STUDIES)) / (n - 1) / n
    t = (abs(difference) / spread + SIGNS[:n_groups] @ means) / np.sqrt(errors.sum(axis=0))
    return float((t >= critical_t(LEVEL / among, largest_t_of_groups((n,) * n_groups))).mean())
