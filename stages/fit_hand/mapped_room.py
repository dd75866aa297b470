"""State centres less certain that were recorded where a wand (`shukotsu wand`) found the tracker wanting.

A receiver's error by the map is taken for the same in all frames, as that of a hand that stays in one place;
what the fit's residuals show of it is in the centre's sd already. Receivers nearer to each other than the
wand's two differ less, in proportion, as a smooth field does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.schemas.catalogue import ROOM_MAP
from shukotsu.schemas.tables import column_array, read_table
from shukotsu.sentences.messages import message_of
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fit import HandFit
from shukotsu.stages.fit_hand.posterior_summary import FittedJoint

NAMED_PERCENT = 5.0
"""Of the poses outside of what is trusted, from which on a problem names it."""


@dataclass(frozen=True)
class MappedRoom:
    """Cells of a room's map that have data: centres_mm (C, 3), error (C, 2) mm and deg, trusted (C,)."""

    centres_mm: Array
    error: Array
    trusted: Array
    cell_mm: float
    bar_mm: float

    @classmethod
    def read(cls, path: Path) -> MappedRoom:
        """Read the table that `shukotsu wand` writes; raises InputError as reading tables does."""
        table = read_table(path, ROOM_MAP)
        rows = {name: column_array(table, name) for name in table.column_names}
        known = np.isfinite(rows["error_mm"])
        centres_mm = np.stack([rows[f"{axis}_mm"] for axis in "xyz"], -1)
        error = np.stack([rows["error_mm"], rows["error_deg"]], -1)
        sizes = (float(rows[name][0]) for name in ("cell_mm", "bar_mm"))
        return cls(centres_mm[known], error[known], rows["trusted"][known].astype(float), *sizes)

    def at(self, position_mm: Array) -> Array:
        """Give (N, 4) at places (N, 3): mm, deg, whether trusted, whether the wand was there.

        Where it was not, the nearest cell speaks: no error at all would reward a wand that moved little.
        """
        from scipy.spatial import KDTree

        nearest = KDTree(self.centres_mm).query(position_mm)[1]
        away_mm = np.abs(position_mm - self.centres_mm[nearest]).max(-1)
        seen = (away_mm <= 0.5 * self.cell_mm).astype(float)
        return np.column_stack([self.error[nearest], self.trusted[nearest] * seen, seen])


def widened(fit: HandFit, room: MappedRoom) -> tuple[HandFit, str]:
    """Give the fit with its centres' covariances grown, and what is to be said of it; empty: nothing."""
    evidence, frames = fit.evidence, fit.evidence.problem.frames
    place_mm = evidence.convention.world(np.eye(3), frames.position_mm)[1]
    squares, poses, weights = dict[str, Array](), list[Array](), list[Array]()
    for s, segment in enumerate(evidence.model.receivers):
        rows = frames.valid[:, s]
        if segment in evidence.model.framed or not rows.any():
            continue
        poses.append(room.at(place_mm[rows, s]))
        weights.append(evidence.share[rows])
        mean = np.average(poses[-1][:, :2] ** 2, axis=0, weights=weights[-1])
        covered = 3.0 * np.square(fit.residual_rms[segment])
        squares[segment] = np.maximum(0.0, mean - np.nan_to_num(covered))
    groups: dict[str, Any] = {
        group: {name: _wider(one, squares, room.bar_mm) for name, one in getattr(fit.summary, group).items()}
        for group in ("joints", "lone", "palm", "fixed")
    }
    wider = replace(fit, summary=replace(fit.summary, **groups))
    pose, weight = np.concatenate(poses), np.concatenate(weights)
    outside, unseen = 100.0 - 100.0 * np.average(pose[:, 2:], axis=0, weights=weight)
    if outside < NAMED_PERCENT:
        return wider, ""
    mm, deg = np.sqrt(np.average(pose[:, :2] ** 2, axis=0, weights=weight)).tolist()
    return wider, message_of(
        "in-mapped-room", mm=mm, deg=deg, percent=float(outside), percent_2=float(unseen)
    )


def _wider(joint: FittedJoint, squares: Mapping[str, Array], bar_mm: float) -> FittedJoint:
    """The joint with its receivers' errors in its covariance; squares : (2,) mm^2 and deg^2 by segment."""
    ends = ((joint.parent_segment, joint.parent_mm), (joint.child_segment, joint.child_mm))
    known = [
        (squares[name], centre) for name, centre in ends if name in squares and np.isfinite(centre).all()
    ]
    apart_mm = sum(float(np.linalg.norm(centre)) for _, centre in known)
    added = sum(own[0] + np.radians(1.0) ** 2 * own[1] * (centre @ centre) for own, centre in known)
    added *= min(1.0, apart_mm / bar_mm) ** 2
    grows = np.repeat([np.isfinite(centre).all() for _, centre in ends], 3)
    return replace(joint, covariance_mm2=joint.covariance_mm2 + np.diag(np.where(grows, added / 3.0, 0.0)))
