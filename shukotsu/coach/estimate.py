"""Estimate the hand from the frames that there are, as the study will, with every joint's verdict by the
study's rule.

Each estimate starts anew, as the study's will: of its time under a second next to none would be saved by
starting from the one before (scales of priors and residuals take it, which must be found alike), and a replay
gives the same numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.coach.movements import MOVEMENTS
from shukotsu.coach.setup import CoachSetup
from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.verdict import BELIEVE, judged_joint
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fingertips import Fingertips, fingertips
from shukotsu.stages.fit_hand.fit import HandFit, Settings, fit_hand
from shukotsu.stages.fit_hand.hand_tables import joint_rows
from shukotsu.stages.fit_hand.measurements import Measurement
from shukotsu.stages.fit_hand.touches import CONTACT_SD_MM, Touch, contact_in, touch_in, with_touches

LEAST_FRAMES = 240
MOST_FITTED = 60
"""Of frames: a third less time than with the study's hundred, and stated errors within 1 % of theirs."""

HELD_S = 0.25
"""A touch is marked while it is held: it lasts from so long before to so long after."""


@dataclass(frozen=True)
class MarkedTouch:
    """A touch that somebody marked at host_ns: numbers (N,) of the frames about then, and what met what."""

    frames: npt.NDArray[np.int64]
    host_ns: int
    digit: str
    part: str
    meets: str = ""
    point_mm: tuple[float, float, float] | None = None
    sd_mm: float = CONTACT_SD_MM

    def held_in(self, came_ns: npt.NDArray[np.int64], frame: npt.NDArray[np.int64]) -> MarkedTouch:
        """Give the touch with those of the frames (N,) in it that came about when it was marked."""
        own = frame[np.abs(came_ns - self.host_ns) <= HELD_S * 1e9]
        return replace(self, frames=np.union1d(self.frames, own)) if len(own) else self


@dataclass(frozen=True)
class Estimate:
    """The hand as known up to time_s of the recording.

    rows : judged rows of joint_centres, of joints between two receivers.
    """

    time_s: float
    tips: Fingertips
    rows: Mapping[str, Mapping[str, Any]]

    @property
    def fit(self) -> HandFit:
        """The fit, with what was touched."""
        return self.tips.fit

    @property
    def sd_mm(self) -> Array:
        """Stated errors (J,) of the joints, in the rows' order."""
        return np.array([row["sd_mm"] for row in self.rows.values()])

    @property
    def open_joints(self) -> list[str]:
        """Joints that are not believed yet."""
        return [name for name, row in self.rows.items() if row["verdict"] != BELIEVE]


def estimate(
    setup: CoachSetup,
    layout: Layout,
    poses: Poses,
    measured: Sequence[Measurement] = (),
    touches: Sequence[MarkedTouch] = (),
) -> Estimate:
    """Fit the hand to all frames; its joints are those that movements can be asked for.

    Raises InputError where the frames are too few, or show no hand.
    """
    if len(poses.frame) < LEAST_FRAMES:
        raise InputError(f"{len(poses.frame)} frames are too few for an estimate; expected {LEAST_FRAMES}")
    moved = {name for one in MOVEMENTS.values() for posture in one.postures for name in posture}
    own = [Measurement(row["quantity"], row["value_mm"], row["sd_mm"]) for row in setup.measurements]
    try:
        fit = fit_hand(
            [poses],
            layout,
            setup.hand,
            hand_length_mm=setup.hand_length_mm,
            hand_breadth_mm=setup.hand_breadth_mm,
            measurements=[*own, *measured],
            settings=Settings(min(MOST_FITTED, setup.fitting.frames), setup.fitting.steps),
        )
        tips = fingertips(fit)
        found = [touch for mark in touches if (touch := _touch(tips, poses, mark)) is not None]
        tips = with_touches(tips, found) if found else tips
    except np.linalg.LinAlgError as error:
        raise InputError(f"the frames so far show no hand ({error})") from error
    names = tips.fit.joints.keys() & moved
    rows = {
        row["joint"]: judged_joint(row, setup.wanted_mm)
        for row in joint_rows(tips.fit)
        if row["joint"] in names
    }
    return Estimate(float(poses.time_s[-1]), tips, rows)


def _touch(tips: Fingertips, poses: Poses, mark: MarkedTouch) -> Touch | None:
    """Give a marked touch as the fit takes it; None where no frame of it has a pose of both receivers."""
    rows = np.flatnonzero(np.isin(poses.frame, mark.frames))
    try:
        if mark.meets:
            return contact_in(tips, poses, rows, (mark.digit, mark.meets), sd_mm=mark.sd_mm)
        point = np.array(mark.point_mm)
        return touch_in(tips, poses, rows, mark.digit, point, sd_mm=mark.sd_mm, part=mark.part)
    except InputError:
        return None
