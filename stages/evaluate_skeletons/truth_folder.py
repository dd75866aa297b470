"""The truth beside a simulated recording: joints and bones, and tips and metacarpals frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from kinematics.rotations import Array, rotate
from schemas.catalogue import BONE_LENGTHS, JOINT_CENTRES, METACARPALS, TIPS
from schemas.errors import InputError
from schemas.poses import Poses, RecordingName
from schemas.tables import read_table, rows_of
from stages.evaluate_skeletons.skeleton_folder import Stated, check_tables, read_digits, stack

OTHER_MM = 0.5
"""A recording's own truth says to rounding how far each tip is from its receiver; another's does not."""

QUATERNION = ("qw", "qx", "qy", "qz")
TIP = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
DISTAL = np.array([1.0, 0.0, 0.0])
"""Where a bone points in its own frame."""


@dataclass(frozen=True)
class TrueDigit:
    """One digit over the T frames of a recording, in the transmitter's frame.

    frame : (T,) in increasing order. tip_mm : (T, 3) end of the distal bone; to_receiver_mm : (T,) its
    distance to the distal receiver as recorded. metacarpal : (T, 4) bone (x distal) to transmitter;
    metacarpal_mm : its length, CMC to MCP.
    """

    frame: npt.NDArray[np.int64]
    tip_mm: Array
    to_receiver_mm: Array
    metacarpal: Array
    metacarpal_mm: float


@dataclass(frozen=True)
class TruthFolder:
    """A recording's truth. stated : its joints, seen from the receivers as mounted, and its bones."""

    path: Path
    name: RecordingName
    stated: Stated

    def digits(self, poses: Poses, tip_of: Mapping[str, str]) -> dict[str, TrueDigit]:
        """Give the digits' truth, its frames numbered as the recording's.

        poses : the recording, with every digit's distal receiver, whose segment `tip_of` names. A captured
        recording may count its frames from another number than the simulation. Raises InputError where the
        truth cannot be read or is not of this recording.
        """
        of_digit = _digits(self.path, self.name)
        if not of_digit or not poses.valid.any():
            return {}
        first = next(iter(of_digit.values())).frame[0]
        off_mm = {
            shift: _off_mm(of_digit, poses, tip_of, shift) for shift in (0, int(poses.frame[0] - first))
        }
        shift = min(off_mm, key=lambda one: off_mm[one])
        if off_mm[shift] > OTHER_MM:
            raise InputError(
                f"{self.path}: is not the truth of this recording of {self.name}, whose receivers are not "
                "where it says that they were recorded; simulate the recording and its truth again"
            )
        return {digit: replace(true, frame=true.frame + shift) for digit, true in of_digit.items()}


def read_truth(path: Path, subject: str, hand: str) -> TruthFolder:
    """Read what a folder of truth tables says of the hand and which recording it is of.

    Raises InputError where its tables cannot be read or are of another hand.
    """
    check_tables(path, (JOINT_CENTRES, BONE_LENGTHS, METACARPALS, TIPS), subject, hand)
    tables = {
        table.name: list(rows_of(read_table(path / f"{table.name}.parquet", table)))
        for table in (JOINT_CENTRES, BONE_LENGTHS)
    }
    named = read_table(path / f"{METACARPALS.name}.parquet", METACARPALS, ("task", "trial")).slice(0, 1)
    for row in rows_of(named):
        name = RecordingName(subject, hand, row["task"], row["trial"])
        return TruthFolder(
            path,
            name,
            Stated(
                {row["joint"]: row for row in tables[JOINT_CENTRES.name]},
                {row["bone"]: row for row in tables[BONE_LENGTHS.name]},
            ),
        )
    raise InputError(f"{path}: its {METACARPALS.name} table has no row; simulate the recording again")


def at_frames(values: Array, known: npt.NDArray[np.int64], wanted: npt.NDArray[np.int64]) -> Array:
    """Rows of `values` (T, ...), which are of the frames `known` (in increasing order), at the frames wanted;
    NaN where one is not known.
    """
    if not len(known):
        return np.full((len(wanted), *values.shape[1:]), np.nan)
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    found = np.array(values[place], float)
    found[known[place] != wanted] = np.nan
    return found


def directions(quaternion: Array) -> Array:
    """Where bones (T, 4) point, (T, 3)."""
    return np.asarray(rotate(quaternion, DISTAL))


def _digits(path: Path, name: RecordingName) -> dict[str, TrueDigit]:
    tips = read_digits(path / f"{TIPS.name}.parquet", TIPS, ("frame", *TIP, "error_mm"), name)
    columns = ("frame", *QUATERNION, "length_mm")
    metacarpals = read_digits(path / f"{METACARPALS.name}.parquet", METACARPALS, columns, name)
    found = {}
    for digit in tips.keys() & metacarpals.keys():
        bone = metacarpals[digit]
        frame = np.asarray(tips[digit]["frame"], np.int64)
        found[digit] = TrueDigit(
            frame,
            stack(tips[digit], TIP),
            tips[digit]["error_mm"],
            at_frames(stack(bone, QUATERNION), np.asarray(bone["frame"], np.int64), frame),
            float(bone["length_mm"][0]),
        )
    return found


def _off_mm(of_digit: Mapping[str, TrueDigit], poses: Poses, tip_of: Mapping[str, str], shift: int) -> float:
    """Median over frames and digits of how much the distance of tip and receiver differs from the truth's;
    infinite where they share no frame.
    """
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
