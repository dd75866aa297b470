"""The hand as the frames so far show it: the study's own fit, with every joint's verdict by the study's rule.

Each estimate starts anew, as the study's will: starting from the one before would save next to nothing of its
time, and a replay gives the same numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.fit.fingertips import Fingertips, fingertips
from shukotsu.fit.fit import Settings, fit_hand
from shukotsu.fit.hand_tables import joint_rows
from shukotsu.fit.measurements import Measurement
from shukotsu.study.layout import Layout
from shukotsu.study.model import HandFitting, SkeletonModel
from shukotsu.study.verdict import BELIEVE, judged_joint
from shukotsu.tables.poses import Poses

LEAST_FRAMES = 240
MOST_FITTED = 60
"""Frames of a fit: a third less time than with the study's hundred, stated errors within 1 % of theirs."""


@dataclass(frozen=True)
class CoachedHand:
    """Whose hand is calibrated, and what the study knows of it. whose : its cells in a sheet, empty without a
    study. layout : of this hand. fitting : of the model. wanted_mm : the 1-sigma error that is asked.
    """

    hand: str
    layout: Layout
    model: SkeletonModel
    fitting: HandFitting
    wanted_mm: float
    whose: Mapping[str, str]
    hand_length_mm: float | None = None
    hand_breadth_mm: float | None = None
    measurements: tuple[Measurement, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """The hand up to time_s of the recording. rows : judged rows of joint_centres, of joints between two
    receivers.
    """

    time_s: float
    tips: Fingertips
    rows: Mapping[str, Mapping[str, Any]]

    @property
    def open_joints(self) -> list[str]:
        """Joints that are not believed yet."""
        return [name for name, row in self.rows.items() if row["verdict"] != BELIEVE]


def estimate(whose: CoachedHand, poses: Poses) -> Estimate:
    """Fit the hand to all frames. Raises InputError where these are too few, or show no hand."""
    if len(poses.frame) < LEAST_FRAMES:
        raise InputError(f"{len(poses.frame)} frames are too few for an estimate; expected {LEAST_FRAMES}")
    try:
        fit = fit_hand(
            [poses],
            whose.layout,
            whose.hand,
            hand_length_mm=whose.hand_length_mm,
            hand_breadth_mm=whose.hand_breadth_mm,
            measurements=whose.measurements,
            settings=Settings(min(MOST_FITTED, whose.fitting.frames), whose.fitting.steps),
        )
        tips = fingertips(fit)
    except np.linalg.LinAlgError as error:
        raise InputError(f"the frames so far show no hand ({error})") from error
    rows = {
        row["joint"]: judged_joint(row, whose.wanted_mm)
        for row in joint_rows(fit)
        if row["joint"] in fit.joints
    }
    return Estimate(float(poses.time_s[-1]), tips, rows)
