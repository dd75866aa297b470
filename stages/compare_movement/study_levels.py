"""The recordings of a study with their level of every factor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.catalogue import RECORDINGS
from schemas.factors import factor_levels
from schemas.study import Study

if TYPE_CHECKING:
    import pandas as pd


def recordings_with_levels(study: Study) -> tuple[pd.DataFrame, list[str]]:
    """Every recording that is used: what tables call it, and a column a factor; and the factors' names."""
    import pandas as pd

    columns = dict.fromkeys([*RECORDINGS.key, *study.factors])
    return pd.DataFrame(factor_levels(study), columns=[*columns]).astype(str), list(study.factors)
