"""The recordings of a study with their level of every factor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.study import Study

if TYPE_CHECKING:
    import pandas as pd


def recordings_with_levels(study: Study) -> tuple[pd.DataFrame, list[str]]:
    """Every recording that is used: what tables call it, and a column a factor; and the factors' names."""
    import pandas as pd

    factors = list(study.config.get("factors", []))
    rows = [recording.key for recording in study.shown]
    frame = pd.DataFrame(rows, columns=["subject", "session", "hand", "task", "trial"]).astype(str)
    return frame, factors
