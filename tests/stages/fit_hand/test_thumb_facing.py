"""A thumb metacarpal's receiver on the nail's side is as good as one on the back of the hand."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.faultless_hands import THUMB, facing_the_nail, nail_turn
from shukotsu.anatomy.average_hand import DIGITS
from shukotsu.anatomy.known_digits import rest_rotations
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import RecordingName
from shukotsu.skeleton.joint_angles import joint_angles
from shukotsu.skeleton.rotations import Array, about_axis, angle, conjugate, matrix, multiply, rotate, unit
from shukotsu.stages.fit_hand.fit import HandFit, Settings, fit_hand
from shukotsu.stages.fit_hand.fitted_motion import joint_angles_of, pose_hand
from shukotsu.stages.fit_hand.posed_tables import angle_columns
from shukotsu.stages.simulate.random_hand import BONES
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import Simulated, simulate

LAYOUT = read_layout("liberty16")
QUICK = Settings(n_frames=40, rounds=1)
SEEDS = (4, 5, 7)
HANDS = pytest.mark.parametrize(
    "seed", [SEEDS[0], *(pytest.param(s, marks=pytest.mark.slow) for s in SEEDS[1:])]
)
SIDES = pytest.mark.parametrize("side", ["right", "left"])
NAIL = {**DIGITS, "thumb": replace(DIGITS["thumb"], faces_nail=True)}


@cache
def fitted(seed: int, side: str, *, nail: bool) -> tuple[Simulated, HandFit]:
    """A hand with its receiver on either side of the thumb, fitted quickly."""
    made = simulate("01", side, "rom", seed, Realism.full(), 2400)
    made = facing_the_nail(made) if nail else made
    return made, fit_hand([made.poses()], LAYOUT, side, settings=QUICK)


def faces_nail(fit: HandFit) -> bool:
    return fit.evidence.model.anatomy["thumb"].faces_nail


def errors_mm(seed: int, side: str, *, nail: bool) -> Array:
    """Errors (2, 2, 3) of the CMC and the MCP joint, parent's and child's half, in the bones' directions."""
    made, fit = fitted(seed, side, nail=nail)
    errors = np.array(
        [
            (joint.parent_mm - true.parent_mm, joint.child_mm - true.child_mm)
            for joint, true in (
                (fit.joints[name], made.truth.joints[name]) for name in ("thumb_cmc", "thumb_mcp")
            )
        ]
    )
    if nail:  # as the receiver on the back of the hand sees them
        errors[[0, 1], [1, 0]] = rotate(nail_turn(made), errors[[0, 1], [1, 0]])
    return errors


@HANDS
@SIDES
def test_both_facings_give_the_same_thumb(seed: int, side: str) -> None:
    """Told apart by the data; no centre is weak, and they differ as two that are as sure as they say."""
    one, other = (errors_mm(seed, side, nail=nail) for nail in (False, True))
    fits = [fitted(seed, side, nail=nail)[1] for nail in (False, True)]
    assert [faces_nail(fit) for fit in fits] == [False, True]
    for row, name in enumerate(("thumb_cmc", "thumb_mcp")):
        sd_mm = [fit.joints[name].sd_mm for fit in fits]
        assert sd_mm[1] < 1.15 * sd_mm[0]
        assert not fits[1].joints[name].doubts
        assert np.linalg.norm(one[row] - other[row], axis=-1).max() < np.hypot(*sd_mm)


@SIDES
def test_the_bone_faces_where_its_receiver_faces(side: str) -> None:
    """Posed bones and angles of the CMC and the MCP joint, against those of the true bone turned likewise."""
    made, fit = fitted(4, side, nail=True)
    rows = np.arange(0, len(made.frame), 24)
    posed = pose_hand(fit, made.poses().take(rows))
    true = made.truth.bone_quaternion[rows]
    true[:, BONES.index(THUMB)] = multiply(true[:, BONES.index(THUMB)], nail_turn(made))
    off = multiply(conjugate(true[:, BONES.index(THUMB)]), posed.bone_quaternion[:, posed.bones.index(THUMB)])
    assert np.degrees(np.median(angle(off))) < 10.0
    places = [BONES.index(name) for name in posed.bones]
    found, expected = (
        joint_angles_of(fit, own) for own in (posed, replace(posed, bone_quaternion=true[:, places]))
    )
    for joint in ("thumb_cmc", "thumb_mcp"):
        assert np.abs(found[joint] - expected[joint]).mean() < 6.0, joint


@SIDES
def test_a_thumb_facing_the_nail_moves_by_its_names(side: str) -> None:
    """A sweep along the palm is flexion and hardly any abduction; leaving the palm at right angles is palmar
    abduction, which is negative, and hardly any flexion.
    """
    rest = rest_rotations(LAYOUT, side, NAIL)["thumb_cmc"]
    dorsal = np.array([0.0, 0.0, 1.0])
    long_axis = matrix(rest)[:, 0]
    ulnarwards = about_axis(dorsal, np.radians(-20.0 if side == "right" else 20.0))
    palmwards = about_axis(unit(np.cross(long_axis, -dorsal)), np.radians(20.0))
    bones = multiply(np.stack([ulnarwards, palmwards]), rest)
    sweep, leaving = joint_angles(np.array([1.0, 0.0, 0.0, 0.0]), bones, side, rest)
    assert sweep[0] > 17.0
    assert abs(sweep[1]) < 5.0
    assert leaving[1] < -17.0
    assert abs(leaving[0]) < 6.0


@SIDES
def test_the_table_of_angles_does_not_know_how_the_receiver_faces(side: str) -> None:
    """Angles of the same motion, seen by a receiver on the back of the hand's side and on the nail's."""
    tables = []
    for nail in (False, True):
        made, fit = fitted(4, side, nail=nail)
        poses = made.poses().take(np.arange(0, len(made.frame), 24))
        tables.append(angle_columns(RecordingName("01", side, "rom"), fit, pose_hand(fit, poses), poses))
    back, front = tables
    own = np.isin(back["joint"].to_pylist(), ["thumb_cmc", "thumb_mcp"])
    for part in ("flexion_deg", "abduction_deg", "rotation_deg"):
        assert np.abs(back[part] - front[part])[own].mean() < 8.0, part
    sweep = back["flexion_deg"][np.array(back["joint"].to_pylist()) == "thumb_cmc"]
    assert np.ptp(sweep) > 15.0
