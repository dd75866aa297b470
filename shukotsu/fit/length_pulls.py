"""The priors' pull on each bone's length: the error that one sd of every unknown of the hand causes.

An estimate from data of information F, with priors of precision L, has the covariance C = (F + L)^-1. Its
error consists of the pull of the priors, -C L x for the true unknowns x, and of the effect of noise, of
covariance C F C. On average over people the two add up to C. A length that is linear in the unknowns with the
row a is pulled by a C L^1/2 per sd of each unknown. These pulls determine how far two estimates of one
person's bone may differ (`shukotsu.scores.agreement`).

On paper: docs/whole-hand.md, section 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shukotsu.fit.posterior import SolvedFit

if TYPE_CHECKING:
    from shukotsu.tables.rows import LengthPullsRow

LEAST_SHARE = 0.01
"""Least pull of an unknown that is listed, as a share of the length's sd."""


def pull_rows(fit: SolvedFit) -> list[LengthPullsRow]:
    """Compute the pulls a C L^1/2 of priors on lengths (docs/whole-hand.md, section 8).

    Parameters
    ----------
    fit : SolvedFit
        The hand; its posterior before conditioning on the other hand and on touches is used.

    Returns
    -------
    list of LengthPullsRow
        Rows of table length_pulls, mm, for pulls above LEAST_SHARE. Bones whose length was measured directly
        have none.

    """
    rows: list[LengthPullsRow] = []
    alone, unknowns = fit.alone, fit.model.unknowns
    for bone, amount in fit.model.length.items():
        row = amount.row(len(alone.x))
        mm, sd_mm = alone.of_amount(amount)
        pulls_mm = row @ alone.covariance * np.sqrt(fit.problem.precision)
        if fit.problem.observations.rows[:, unknowns.names.index(f"{bone} length")].any():
            continue
        rows += [
            {
                "bone": bone,
                "unknown": unknowns.names[i],
                "group": unknowns.groups[i],
                "pull_mm": float(pulls_mm[i]),
                "alone_mm": mm,
                "alone_sd_mm": sd_mm,
            }
            for i in np.flatnonzero(np.abs(pulls_mm) > LEAST_SHARE * sd_mm)
        ]
    return rows
