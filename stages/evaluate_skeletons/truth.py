"""The truth beside a simulated recording: joints and bones, and tips and metacarpals frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError, reading_what_was_brought
from shukotsu.schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS, TIPS
from shukotsu.schemas.parts import numbers_by_name
from shukotsu.schemas.poses import Poses, RecordingName
from shukotsu.schemas.study import Hand
from shukotsu.schemas.tables import Table, read_table, rows_of
from shukotsu.skeleton.posed_recording import QUATERNION
from shukotsu.skeleton.rotations import Array, rotate
from shukotsu.stages.evaluate_skeletons.scored_skeleton import TIP, Row, Stated

OTHER_MM = 0.5
"""A recording's own truth says to rounding how far each tip is from its receiver; another's does not."""

DISTAL = np.array([1.0, 0.0, 0.0])
"""Where a bone points in its own frame."""


@dataclass(frozen=True)
class TrueDigit:
    """A digit in T frames, transmitter's frame: bone's tip, distance to the receiver, metacarpal."""

    frame: npt.NDArray[np.int64]
    tip_mm: Array
    to_receiver_mm: Array
    metacarpal: Array
    metacarpal_mm: float


@dataclass(frozen=True)
class Truth:
    """A recording's truth. stated : its joints, seen from the receivers as they rode, and its bones."""

    folder: Path
    name: RecordingName
    stated: Stated

    def digits(self, poses: Poses, tip_of: Mapping[str, str]) -> dict[str, TrueDigit]:
        """The digits' truth, its frames numbered as the recording's, which may count from another number.

        tip_of : digits' distal segments. Raises InputError where the truth cannot be read or is not of this
        recording.
        """
        of_digit = _digits(self.folder)
        if not of_digit or not poses.valid.any():
            return {}
        first = next(iter(of_digit.values())).frame[0]
        off_mm = {
            shift: _off_mm(of_digit, poses, tip_of, shift) for shift in (0, int(poses.frame[0] - first))
        }
        shift = min(off_mm, key=lambda shift: off_mm[shift])
        if off_mm[shift] > OTHER_MM:
            raise InputError(
                f"{self.folder}: is not the truth of this recording of {self.name}, whose receivers are not "
                "where it says that they were recorded; simulate the recording and its truth again"
            )
        return {digit: replace(true, frame=true.frame + shift) for digit, true in of_digit.items()}


def read_truth(folder: Path, name: RecordingName) -> Truth:
    """Read a folder's truth of a recording's hand. Raises InputError where it is another's."""
    joints, bones = _rows(folder, JOINT_CENTRES, name), _rows(folder, BONE_LENGTHS, name)
    stated = Stated({row["joint"]: row for row in joints}, {row["bone"]: row for row in bones})
    return Truth(folder, name, stated)


def _rows(folder: Path, table: Table, name: RecordingName) -> list[Row]:
    """Rows of a table of a folder; InputError where they are of another hand than the recording."""
    path = folder / f"{table.name}.parquet"
    with reading_what_was_brought():
        rows = list(rows_of(read_table(path, table)))
    for hand in {Hand(row["subject"], row["hand"], row["session"]) for row in rows} - {name.of_hand}:
        raise InputError(f"{path}: is of {hand}; expected {name.of_hand}")
    return rows


def at_frames(values: Array, known: npt.NDArray[np.int64], wanted: npt.NDArray[np.int64]) -> Array:
    """Rows of `values` (T, ...) of the frames `known`, rising, at the frames wanted; NaN where not known."""
    if np.array_equal(known, wanted):
        return values
    if not len(known):
        return np.full((len(wanted), *values.shape[1:]), np.nan)
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    rows = np.array(values[place], float)
    rows[known[place] != wanted] = np.nan
    return rows


def directions(quaternion: Array) -> Array:
    """The directions of bones (T, 4), (T, 3)."""
    return np.asarray(rotate(quaternion, DISTAL))


def _digits(folder: Path) -> dict[str, TrueDigit]:
    tips = _by_digit(folder, TIPS, ("frame", *TIP, "error_mm"))
    metacarpals = _by_digit(folder, METACARPALS, ("frame", *QUATERNION, "length_mm"))
    digits = {}
    for digit in tips.keys() & metacarpals.keys():
        tip, bone = tips[digit], metacarpals[digit]
        frame = tip[:, 0].astype(np.int64)
        metacarpal = at_frames(directions(bone[:, 1:5]), bone[:, 0].astype(np.int64), frame)
        digits[digit] = TrueDigit(frame, tip[:, 1:4], tip[:, 4], metacarpal, float(bone[0, 5]))
    return digits


def _by_digit(folder: Path, table: Table, columns: Sequence[str]) -> dict[str, Array]:
    """Numbers (T, columns) of each digit."""
    with reading_what_was_brought():
        rows = read_table(folder / f"{table.name}.parquet", table, ["digit", *columns])
    return numbers_by_name(rows, "digit", columns)


def _off_mm(of_digit: Mapping[str, TrueDigit], poses: Poses, tip_of: Mapping[str, str], shift: int) -> float:
    """Median of how far tips' distances to receivers differ from the truth's; infinite without a frame."""
    off = [np.empty(0)]
    for digit, true in of_digit.items():
        if digit in tip_of:
            index = poses.index(tip_of[digit])
            tip_mm = at_frames(true.tip_mm, true.frame + shift, poses.frame)
            stated = at_frames(true.to_receiver_mm, true.frame + shift, poses.frame)
            distance = np.linalg.norm(tip_mm - poses.position_mm[:, index], axis=-1)
            off.append(np.abs(distance - stated)[poses.valid[:, index]])
    together = np.concatenate(off)
    known = together[np.isfinite(together)]
    return float(np.median(known)) if len(known) else float("inf")
