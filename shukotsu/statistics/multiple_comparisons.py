"""Many comparisons made together: S. Holm, Scand. J. Stat. 6, 1979."""

from __future__ import annotations

from collections.abc import Sequence

LEVEL = 0.05
"""Share of false positives that is accepted, in a family of comparisons made together."""


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Holm's corrected p-values, in the same order; None is no test and stays so."""
    known = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    corrected: list[float | None] = [None] * len(p_values)
    highest = 0.0
    for rank, (p, place) in enumerate(known):
        highest = max(highest, min(1.0, p * (len(known) - rank)))
        corrected[place] = highest
    return corrected
