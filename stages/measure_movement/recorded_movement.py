"""Joint angles and fingertips of a recording under a model, as the tables of its subject have them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from anatomy.neutral_bones import bone_angles_deg, to_nail_side
from schemas.catalogue import BONE_POSES, JOINT_ANGLES, POSED_TIPS
from schemas.layout import Digit
from schemas.parts import read_recording
from schemas.plan import SubjectPlan
from schemas.poses import Poses, read_poses
from schemas.study import Recording
from schemas.tables import Table
from skeleton.posed_recording import read_motion, read_skeleton
from skeleton.posing import PosedBones, pose_bones
from skeleton.rotations import Array, conjugate, rotate

ANGLES = ("flexion", "abduction", "rotation")

ERRORS = ("sd_deg", "change_sd_deg", "session_sd_deg", "session_change_sd_deg")
"""Columns of joint_angles, without the angle's name."""

_BONE_POSE = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
DOUBTED = "its centre is not to be believed"
_BLOCK_FRAMES = 1 << 15
_FACING_FRAMES = 512
"""Frames of a recording, evenly spaced, that show which way a thumb's receiver faces."""


@dataclass(frozen=True)
class AngleSeries:
    """One angle of J joints over T frames: (T, J) degrees, NaN in gaps.

    errors_deg : (T, J, E) the errors in `ERRORS`, NaN where they are not known.
    """

    angle: str
    joints: tuple[str, ...]
    angle_deg: Array
    errors_deg: Array


@dataclass(frozen=True)
class Fingertip:
    """The end of a digit in the hand's frame, (T, 3) mm, and where its distal receiver points, (T, 3).

    sd_mm : (T,) 1-sigma error in 3-D, NaN where none is stated. skin : whether it is the end of the skin.
    """

    place_mm: Array
    pointing: Array
    sd_mm: Array
    skin: bool


class RecordedMovement:
    """One recording of a subject under one model. Raises InputError where a table cannot be read."""

    def __init__(self, plan: SubjectPlan, recording: Recording, model: str) -> None:
        self._plan, self._recording, self._model = plan, recording, model
        self.hand = recording.hand.hand
        self._layout = plan.layouts[self.hand]
        self.poses: Poses = read_poses(plan.poses(recording), self._layout.measured)
        self._fitted = plan.models[model].fitting is not None
        self._skeleton = read_skeleton(plan, self.hand, model)

    def reliability(self, joint: str) -> tuple[str, str]:
        """Status and message of a joint's centre."""
        row = self._skeleton.joints.get(joint)
        if row is None:
            return "failed", "the joint was not solved"
        return row["status"], DOUBTED if row["status"] == "weak" else row["message"]

    def unsolved(self) -> Mapping[str, str]:
        """Why each joint failed, where no joint of a digit was solved; else nothing."""
        in_digits = {joint for digit in self._layout.digits.values() for joint in digit.joints}
        rows = {joint: row for joint, row in self._skeleton.joints.items() if joint in in_digits}
        solved = any(row["status"] != "failed" for row in rows.values())
        return {} if solved else {joint: row["message"] for joint, row in rows.items()}

    def left_out(self) -> Mapping[str, str]:
        """Joints that the model cannot pose, and why."""
        reasons = {} if self._fitted else self._ridden[2]
        return {joint: reasons[name] for name in reasons for joint in self._layout.digits[name].joints}

    def angles(self) -> Iterator[AngleSeries]:
        """Flexion, abduction and rotation in turn, each of all joints."""
        for index, angle in enumerate(ANGLES):
            if self._fitted:
                columns = [f"{angle}_{what}" for what in ("deg", *ERRORS)]
                by_joint = self._table(JOINT_ANGLES, "joint", columns)
            else:
                unknown = np.full((len(self.poses.frame), len(ERRORS)), np.nan)
                by_joint = {
                    joint: np.column_stack([own[:, index], unknown]) for joint, own in self._ridden[0].items()
                }
            none = np.empty((len(self.poses.frame), 0, 1 + len(ERRORS)))
            stacked = np.stack([*by_joint.values()], 1) if by_joint else none
            yield AngleSeries(angle, tuple(by_joint), running_on(stacked[..., 0]), stacked[..., 1:])

    def fingertips(self) -> dict[str, Fingertip]:
        """The ends of all digits that have one."""
        ends = self._fitted_ends() if self._fitted else self._ridden_ends()
        return {
            name: Fingertip(
                self._in_hand(digit, ends[name][0], place=True),
                self._in_hand(digit, self._pointing(digit)),
                ends[name][1],
                ends[name][2],
            )
            for name, digit in self._layout.digits.items()
            if name in ends
        }

    def _fitted_ends(self) -> dict[str, tuple[Array, Array, bool]]:
        """Where digits end, its error and whether that is the skin's end; the bone's of unknown anatomy."""
        columns = [
            f"{end}_{what}" for end in ("skin_tip", "tip") for what in ("x_mm", "y_mm", "z_mm", "sd_mm")
        ]
        found = {}
        for digit, values in self._table(POSED_TIPS, "digit", columns).items():
            skin = bool(np.isfinite(values[:, :3]).any())
            own = values[:, :4] if skin else values[:, 4:]
            found[digit] = own[:, :3], own[:, 3], skin
        return found

    def _ridden_ends(self) -> dict[str, tuple[Array, Array, bool]]:
        unknown = np.full(len(self.poses.frame), np.nan)
        return {digit: (place, unknown, False) for digit, place in self._ridden[1].items()}

    @cached_property
    def _ridden(self) -> tuple[dict[str, Array], dict[str, Array], Mapping[str, str]]:
        """Angles (T, 3) by joint and ends (T, 3) by digit of a skeleton that rides on receivers; digits that
        are left out and why.
        """
        count = len(self.poses.frame)
        bones = self._posed(slice(0, None, max(1, count // _FACING_FRAMES)))
        facing = to_nail_side(self._layout, self.hand, bones.joints, bones.quaternion)
        pieces: list[dict[str, Array]] = []
        ends: list[dict[str, Array]] = []
        for start in range(0, max(count, 1), _BLOCK_FRAMES):
            bones = self._posed(slice(start, start + _BLOCK_FRAMES))
            pieces.append(bone_angles_deg(self._layout, self.hand, bones, facing))
            ends.append({j.digit: bones.position_mm[:, i] for i, j in enumerate(bones.joints) if j.tip})
        return _joined(pieces), _joined(ends), bones.left_out

    def _posed(self, rows: slice) -> PosedBones:
        poses = self.poses.take(rows)
        motion = read_motion(self._plan, self._recording, self._model, poses.frame)
        return pose_bones(self._skeleton, poses, motion)

    def _table(
        self, table: Table, by: str, columns: Sequence[str], rows: slice = slice(None)
    ) -> dict[str, Array]:
        """Columns (T, C) of a table of the fit, by joint, digit or segment; rows : some of the frames."""
        path = self._plan.fit_table(self.hand, self._model, table.name)
        part, own = self._plan.part(self.hand, self._model), self._recording
        frame = self.poses.frame[rows]
        ends = (int(frame[0]), int(frame[-1])) if len(frame) else None
        return read_recording(path, table, part, own.task, own.trial, by, columns, len(frame), ends)

    def _pointing(self, digit: Digit) -> Array:
        """Where the last bone's receiver points by its layout, (T, 3) in the transmitter frame."""
        distal = np.array(self._layout.segments[digit.tip].distal, float)
        return rotate(self._turn(digit.tip), distal)

    def _in_hand(self, digit: Digit, vectors: Array, *, place: bool = False) -> Array:
        """Places or directions (T, 3) in the frame of what the digit hangs from."""
        base_mm, turn = self._bases[digit.base]
        return rotate(conjugate(turn), vectors - base_mm if place else vectors)

    @cached_property
    def _bases(self) -> dict[str, tuple[Array, Array]]:
        """Where the bones are that digits hang from, (T, 3) and (T, 4): as fitted, else their receivers."""
        names = {digit.base for digit in self._layout.digits.values()}
        if not self._fitted:
            return {
                name: (self.poses.position_mm[:, self.poses.index(name)], self._turn(name)) for name in names
            }
        pieces: list[dict[str, Array]] = []
        for start in range(0, max(len(self.poses.frame), 1), _BLOCK_FRAMES):  # of many bones few are kept
            read = self._table(BONE_POSES, "segment", _BONE_POSE, slice(start, start + _BLOCK_FRAMES))
            pieces.append({name: read[name] for name in names})
        return {name: (pose[:, :3], pose[:, 3:]) for name, pose in _joined(pieces).items()}

    def _turn(self, segment: str) -> Array:
        index = self.poses.index(segment)
        return np.where(self.poses.valid[:, index, None], self.poses.quaternion[:, index], np.nan)


def running_on(angle_deg: Array) -> Array:
    """Angles (T, J) within (-180, 180] degrees, those that pass 180 as they run on beyond it.

    The circle is cut where an angle is not: in the widest arc between its values. NaN stays.
    """
    out = angle_deg
    if not len(angle_deg):
        return out
    spread_deg = np.fmax.reduce(angle_deg, 0) - np.fmin.reduce(angle_deg, 0)
    for joint in np.flatnonzero(spread_deg > 180.0):
        known = np.sort(angle_deg[~np.isnan(angle_deg[:, joint]), joint])
        arcs = np.diff(known, append=known[0] + 360.0)
        widest = int(np.argmax(arcs))
        if widest + 1 < len(known):
            below = 2 * (widest + 1) < len(known)  # turned are the fewer, so that the median stays
            turned = angle_deg[:, joint] <= known[widest]
            out = out.copy() if out is angle_deg else out
            out[turned if below else ~turned, joint] += 360.0 if below else -360.0
    return out


def _joined(pieces: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    return {name: np.concatenate([own[name] for own in pieces]) for name in pieces[0]}
