"""What the tracker sees, and whether the truth beside it is true."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from schemas.errors import InputError
from schemas.layout import read_layout
from skeleton import rotations
from stages.simulate import simulation
from stages.simulate.random_hand import BONES, FINGERS, FLEXION, JOINTS
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated
from stages.simulate.tracker_errors import NOISE_DEG, NOISE_MM

EXACT, FULL = Realism.exact(), Realism.full()
SHORT = 600
simulate = cache(simulation.simulate)


def moved(first: Simulated, second: Simulated) -> tuple[np.ndarray, np.ndarray]:
    """How far receivers stand apart in two recordings: mm (T, S, 3) and degrees (T, S)."""
    turn = rotations.multiply(rotations.conjugate(first.quaternion), second.quaternion)
    return second.position_mm - first.position_mm, np.degrees(rotations.angle(turn))


def test_same_seed_same_numbers_other_names_other_numbers() -> None:
    first = simulate("01", "right", "opposition", 7, FULL, SHORT)
    again = simulation.simulate("01", "right", "opposition", 7, FULL, SHORT)
    assert first.position_mm.tobytes() == again.position_mm.tobytes()
    assert first.quaternion.tobytes() == again.quaternion.tobytes()
    for other in (("02", "right", 7), ("01", "left", 7), ("01", "right", 8)):
        different = simulate(other[0], other[1], "opposition", other[2], FULL, SHORT)
        assert np.abs(different.position_mm - first.position_mm).max() > 1


def test_tasks_share_the_hand_and_its_receivers() -> None:
    first, second = (simulate("01", "right", task, 7, FULL, SHORT).truth for task in ("opposition", "rom"))
    np.testing.assert_array_equal(first.hand.length_mm, second.hand.length_mm)
    np.testing.assert_array_equal(first.mounts.position_mm, second.mounts.position_mm)


def test_another_session_is_the_same_hand_with_receivers_put_on_anew() -> None:
    first, second, again = (
        simulation.simulate("01", "right", "rom", 7, FULL, SHORT, session=session)
        for session in ("", "2", "2")
    )
    np.testing.assert_array_equal(first.truth.hand.length_mm, second.truth.hand.length_mm)
    apart = np.abs(first.truth.mounts.position_mm - second.truth.mounts.position_mm)
    assert (apart.max(1) > 0.05).all()
    assert np.abs(first.position_mm - second.position_mm).max() > 1
    assert second.position_mm.tobytes() == again.position_mm.tobytes()


@pytest.mark.parametrize("task", ["opposition", "rom"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_exact_joints_are_hinges_in_the_childs_sagittal_plane(side: str, task: str) -> None:
    simulated = simulate("01", side, task, 7, EXACT, forearm=True)
    layout = read_layout("liberty16")
    assert set(simulated.truth.joints) == {joint.name for joint in layout.solvable}
    for joint in simulated.truth.joints.values():
        assert joint.gap_mm.max() < 1e-9
        assert abs(joint.child_mm[1]) < 1e-12
        assert abs(joint.axis_child[1]) > 0.8
        if not joint.name.endswith("_dip"):
            assert joint.range_deg > 10
        parent, child = (
            simulated.quaternion[:, simulated.segments.index(name)]
            for name in (joint.parent_segment, joint.child_segment)
        )
        apart = rotations.rotate(parent, joint.axis_parent) - rotations.rotate(child, joint.axis_child)
        assert np.abs(apart).max() < 1e-12


@pytest.mark.parametrize("side", ["right", "left"])
def test_exact_mcp_axes_are_perpendicular_to_the_metacarpal(side: str) -> None:
    simulated = simulate("01", side, "opposition", 7, EXACT, SHORT)
    truth = simulated.truth
    for digit in ("thumb", *FINGERS):
        base = BONES.index("thumb_metacarpal" if digit == "thumb" else "hand")
        bone = BONES.index(f"{digit}_proximal")
        along = truth.bone_position_mm[:, bone] - truth.bone_position_mm[:, base]
        proximal = simulated.quaternion[:, simulated.segments.index(f"{digit}_proximal")]
        joint = truth.joints[f"{digit}_mcp"]
        assert np.abs((along * rotations.rotate(proximal, joint.axis_child)).sum(-1)).max() < 1e-9
        assert abs(joint.axis_child[2]) < 1e-12  # so that the bone's normal turns in one plane


def test_exact_wrist_is_the_layouts_nominal_point() -> None:
    wrist = simulate("01", "right", "opposition", 7, EXACT, SHORT).truth.joints["wrist"]
    nominal = read_layout("liberty16").wrist
    assert nominal is not None
    np.testing.assert_allclose(wrist.child_mm, nominal.nominal_mm, atol=1e-12)


@pytest.mark.parametrize("subject", ["01", "02"])
def test_full_realism_opens_gaps_of_millimetres(subject: str) -> None:
    for task in ("opposition", "rom"):
        truth = simulate(subject, "left", task, 7, FULL).truth
        gaps = [np.sqrt(np.mean(joint.gap_mm**2)) for joint in truth.joints.values() if joint.parent_segment]
        assert len(gaps) == 15
        assert min(gaps) > 0.3
        assert max(gaps) < 8


@pytest.mark.parametrize("side", ["right", "left"])
def test_truth_is_where_centres_were_on_average_as_the_receivers_rode(side: str) -> None:
    """Without tracker and field, recorded poses are those of the receivers on the skin; with them, the truth
    is the same.
    """
    realism = replace(FULL, noise=0.0, field_distortion=0.0)
    made = simulate("01", side, "rom", 7, realism, SHORT)
    turn, truth = rotations.matrix(made.quaternion), made.truth
    noisy = simulate("01", side, "rom", 7, FULL, SHORT).truth.joints
    for name, joint in truth.joints.items():
        centre_mm = truth.bone_position_mm[:, JOINTS.index(name) + 1]
        for segment, stated in (
            (joint.parent_segment, joint.parent_mm),
            (joint.child_segment, joint.child_mm),
        ):
            if segment:
                own = made.segments.index(segment)
                seen = np.einsum("tba,tb->ta", turn[:, own], centre_mm - made.position_mm[:, own])
                np.testing.assert_allclose(stated, seen.mean(0), atol=1e-9)
        np.testing.assert_array_equal(joint.child_mm, noisy[name].child_mm)
    for own, segment in enumerate(made.segments):
        bone = rotations.matrix(truth.bone_quaternion[:, BONES.index(segment)])
        seen = np.einsum("tba,tb->ta", turn[:, own], bone[..., 0]).mean(0)
        np.testing.assert_allclose(truth.along[own], seen / np.linalg.norm(seen), atol=1e-12)


def test_a_gliding_centre_is_stated_where_least_squares_find_it() -> None:
    """Of hinges that glide by millimetres and do nothing else, across their axes: the two points that stay
    together best are a fraction of a millimetre from those stated, on either receiver.
    """
    made = simulate("01", "right", "rom", 7, replace(EXACT, glide=1.0), SHORT)
    turn, off_mm = rotations.matrix(made.quaternion), []
    for joint in made.truth.joints.values():
        if joint.parent_segment:
            parent, child = (made.segments.index(s) for s in (joint.parent_segment, joint.child_segment))
            both = np.concatenate([turn[:, parent], -turn[:, child]], -1).reshape(-1, 6)
            apart = (made.position_mm[:, child] - made.position_mm[:, parent]).ravel()
            found = np.linalg.lstsq(both, apart, rcond=1e-6)[0]
            for own, stated, axis in (
                (found[:3], joint.parent_mm, joint.axis_parent),
                (found[3:], joint.child_mm, joint.axis_child),
            ):
                off = own - stated
                off_mm.append(np.linalg.norm(off - (off @ axis) * axis))
    assert np.linalg.norm(made.truth.hand.glide_mm[:, 0], axis=-1).max() > 1.5
    assert np.sqrt(np.mean(np.square(off_mm))) < 0.25
    assert max(off_mm) < 0.6


def test_noise_has_the_sd_that_it_says() -> None:
    quiet = simulate("01", "right", "opposition", 7, EXACT)
    shift, turn = moved(quiet, simulate("01", "right", "opposition", 7, replace(EXACT, noise=2.0)))
    assert shift.std() == pytest.approx(2 * NOISE_MM, rel=0.02)
    assert np.sqrt(np.mean(turn**2)) == pytest.approx(2 * NOISE_DEG * np.sqrt(3), rel=0.02)


def test_field_distortion_is_static_and_common_to_neighbours() -> None:
    quiet = simulate("01", "right", "opposition", 7, EXACT)
    shift, turn = moved(quiet, simulate("01", "right", "opposition", 7, replace(EXACT, field_distortion=1.0)))
    assert 0.05 < np.abs(shift).max() < 4
    assert 0.05 < turn.max() < 3
    near = quiet.segments.index("index_middle"), quiet.segments.index("index_distal")
    assert np.abs(shift[:, near[0]] - shift[:, near[1]]).max() < 0.5


def test_thumb_metacarpal_receiver_under_reads() -> None:
    quiet = simulate("01", "right", "rom", 7, EXACT)
    shaken = simulate("01", "right", "rom", 7, replace(EXACT, artefact=1.0))
    own, palm = (quiet.segments.index(name) for name in ("thumb_metacarpal", "hand"))
    ranges = []
    for simulated in (quiet, shaken):
        turn = rotations.multiply(
            rotations.conjugate(simulated.quaternion[:, palm]), simulated.quaternion[:, own]
        )
        since = rotations.multiply(rotations.conjugate(turn[:1]), turn)
        ranges.append(rotations.angle(since).max())
    assert 0.5 < ranges[1] / ranges[0] < 0.9


@pytest.mark.parametrize(
    ("switch", "joint", "axis"),
    [("mobile_palm", "little_cmc", FLEXION), ("hinges_only", "index_mcp", 1)],
)
def test_switches_drop_one_assumption_alone(switch: str, joint: str, axis: int) -> None:
    dropped = simulate("01", "right", "rom", 7, replace(EXACT, **{switch: not getattr(EXACT, switch)}), SHORT)
    kept = simulate("01", "right", "rom", 7, EXACT, SHORT)
    index = JOINTS.index(joint)
    assert np.ptp(dropped.truth.angles_rad[:, index, axis]) > 0.1
    assert np.ptp(kept.truth.angles_rad[:, index, axis]) == 0
    differ = (dropped.truth.angles_rad != kept.truth.angles_rad).any((0, 2))
    others = {name for name, different in zip(JOINTS, differ, strict=True) if different}
    expected = (
        {f"{digit}_cmc" for digit in FINGERS}
        if switch == "mobile_palm"
        else {name for name in JOINTS if name not in {f"{digit}_cmc" for digit in FINGERS}}
    )
    assert others == expected


def test_misplaced_receivers_leave_the_joints_hinges() -> None:
    truth = simulate("01", "right", "rom", 7, replace(EXACT, mounts=1.0), SHORT).truth
    assert rotations.angle(truth.mounts.quaternion).min() > 0
    for joint in truth.joints.values():
        if joint.parent_segment:
            assert joint.gap_mm.max() < 1e-9


@pytest.mark.parametrize(
    ("hand", "task", "seed", "n_frames", "said"),
    [
        ("both", "rom", 1, 10, "hand 'both'"),
        ("left", "juggling", 1, 10, "task 'juggling'"),
        ("left", "rom", -1, 10, "seed -1"),
        ("left", "rom", 1, 1, "1 frames"),
    ],
)
def test_unusable_arguments_are_refused(hand: str, task: str, seed: int, n_frames: int, said: str) -> None:
    with pytest.raises(InputError, match=said):
        simulate("01", hand, task, seed, EXACT, n_frames)
