"""The accuracy benchmark's own mathematics: errors against known values, what is injected, the protocol."""

from __future__ import annotations

import argparse
import math
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks import accuracy, peers
from benchmarks.accuracy import accuracy_figure, accuracy_tables, estimators, literature
from benchmarks.accuracy.running import person_result
from benchmarks.accuracy.scenarios import BY_KEY, CLEAN, FOREIGN, FULL, LATE, STIFF, Scenario
from benchmarks.accuracy.score import (
    JOINT_TYPES,
    PHALANGES,
    BoneError,
    Centre,
    Estimate,
    HandScore,
    JointError,
    coverage,
    joint_error,
    phalanges_mm,
    score,
    summary,
)
from benchmarks.accuracy.tip_scores import TRUE, tip_error
from benchmarks.accuracy.trials import Trial, bursts, record, true_length_mm, with_dip_range
from schemas.poses import Poses
from skeleton.rotations import about_axis, angle, conjugate, matrix, multiply, rotate, unit
from stages.evaluate_skeletons.truth_errors import line_angle_deg
from stages.simulate.random_hand import FLEXION, JOINTS
from stages.simulate.realism import Realism
from stages.simulate.simulated_truth import TrueJoint
from stages.simulate.simulation import simulate
from stages.simulate.task_motion import RATE_HZ

N = 480
X, Y, Z = np.eye(3)


def true_joint() -> TrueJoint:
    nothing = np.zeros(N)
    return TrueJoint("index_dip", "index_middle", "index_distal", 1, 5 * X, -8 * X, Y, Y, 60.0, nothing)


@pytest.fixture(scope="module")
def trial() -> Trial:
    return record(3, "left", FULL, N)


def truth_as_estimate(trial: Trial) -> Estimate:
    centres = {
        name: Centre(joint.parent_mm, joint.child_mm, np.eye(6), -joint.axis_child)
        for name, joint in trial.truth.joints.items()
        if joint.parent_segment
    }
    return Estimate(centres, 0.5, phalanges_mm(centres), {"ring_metacarpal": 2.0})


def test_an_error_is_split_along_and_across_the_axis() -> None:
    off = joint_error(true_joint(), Centre(5 * X, -8 * X + [3.0, -4.0, 12.0]), hinge=True)
    assert (off.child_mm, off.along_mm, off.across_mm) == pytest.approx((13.0, 4.0, math.hypot(3, 12)))
    assert math.isnan(off.axis_deg)
    assert off.in_radius is None


def test_an_axis_has_no_sign_and_belongs_to_hinges() -> None:
    tilted = -np.array([0.0, np.cos(0.1), np.sin(0.1)])
    assert line_angle_deg(tilted, Y) == pytest.approx(np.degrees(0.1))
    centre = Centre(5 * X, -8 * X, None, tilted)
    assert joint_error(true_joint(), centre, hinge=True).axis_deg == pytest.approx(np.degrees(0.1))
    assert math.isnan(joint_error(true_joint(), centre, hinge=False).axis_deg)


def test_coverage_is_that_of_the_stated_covariance() -> None:
    """Errors drawn from a covariance are in its 95 % ellipsoid 95 % of the time; round ones in the radius."""
    rng = np.random.default_rng(0)
    root = rng.standard_normal((6, 6))
    covariance = root @ root.T
    drawn = rng.standard_normal((4000, 6)) @ root.T
    inside = [coverage(e[:3], e[3:], covariance)[1] for e in drawn]
    assert np.mean([share for share in inside if share is not None]) == pytest.approx(0.95, abs=0.01)
    radius = [coverage(e[:3], 0 * e[3:], np.eye(6))[0] for e in rng.standard_normal((4000, 6))]
    assert np.mean(radius) == pytest.approx(0.95, abs=0.015)
    assert coverage(X, X, np.diag([1.0, 1, 1, 1, 0, 1]))[1] is None


def test_the_truth_has_no_error(trial: Trial) -> None:
    """But that a bone between two centres, each a mean over a tilting receiver's frames, is a bit short."""
    found = score("truth", trial, truth_as_estimate(trial))
    assert len(found.joints) == 15
    assert max(joint.child_mm for joint in found.joints) == 0.0
    assert max(abs(bone.percent) for bone in found.bones) < 0.5
    assert len(found.bones) == len(PHALANGES) == 9
    hinges = [joint.axis_deg for joint in found.joints if np.isfinite(joint.axis_deg)]
    assert len(hinges) == 9
    assert max(hinges) < 1e-6


def test_a_summary_counts_what_there_is() -> None:
    joints = tuple(
        JointError("index_dip", mm, mm, 0.0, float("nan"), inside, None)
        for mm, inside in ((1.0, 1.0), (2.0, 1.0), (9.0, 0.0), (float("nan"), None))
    )
    bones = BoneError("index_proximal", -4.0, 1.0), BoneError("index_metacarpal", 9.0, 0.0)
    found = summary([HandScore("any", joints, (), (), 2.0), HandScore("any", (), bones, (), 4.0)])
    expected = {"n_hands": 2, "median_mm": 2.0, "seconds": 3.0, "bone_percent": 4.0}
    expected |= {"gross_percent": 100 / 3, "radius_percent": 200 / 3, "length_percent": 50.0}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert (found["axis_deg"], found["palm_deg"], found["ellipsoid_percent"]) == (None, None, None)


def test_a_tip_error_is_constant_and_moving() -> None:
    off = np.array([[3.0, 4.0, 1.0], [3.0, 4.0, -1.0], [np.nan] * 3])
    found = tip_error("any", "index", off)
    assert (found.constant_mm, found.moving_mm, found.mean_mm) == pytest.approx((5.0, 1.0, math.sqrt(26)))


def test_the_plain_scenario_is_the_simulator(trial: Trial) -> None:
    made = simulate("01", "left", "rom", 3, Realism.full(), N)
    np.testing.assert_array_equal(trial.poses.position_mm, made.position_mm)
    np.testing.assert_array_equal(trial.poses.quaternion, made.quaternion)
    np.testing.assert_array_equal(trial.truth.tip_mm, made.truth.tip_mm)
    assert trial.hand_length_mm is None


@pytest.mark.parametrize(
    "scenario",
    [
        FOREIGN,
        LATE,
        Scenario("talk", cross_talk=0.1),
        Scenario("field", realism=Realism(field_distortion=3.0)),
    ],
)
def test_what_is_injected_leaves_the_bones_alone(trial: Trial, scenario: Scenario) -> None:
    """Another skin, cross-talk and field change what is recorded and nothing of the hand."""
    other = record(3, "left", scenario, N)
    np.testing.assert_array_equal(other.truth.bone_position_mm, trial.truth.bone_position_mm)
    moved = np.linalg.norm(other.poses.position_mm - trial.poses.position_mm, axis=-1).max(0)
    turned = angle(multiply(conjugate(trial.poses.quaternion), other.poses.quaternion)).max(0)
    if scenario.cross_talk:
        middle = [segment.endswith("_middle") for segment in trial.poses.segments]
        assert moved.max() < 0.2  # through the field alone
        np.testing.assert_array_equal(turned > np.radians(1.0), middle)
        bent = np.abs(trial.truth.angles_rad[:, JOINTS.index("index_pip"), FLEXION]).max()
        assert turned[middle].max() == pytest.approx(0.1 * bent, rel=0.2)
    else:
        assert np.median(moved) > 0.2


def test_a_dip_range_is_what_was_asked_for(trial: Trial) -> None:
    scaled = with_dip_range(trial.truth.angles_rad, 7.0)
    dip, pip = JOINTS.index("ring_dip"), JOINTS.index("ring_pip")
    assert np.degrees(np.ptp(scaled[:, dip, FLEXION])) == pytest.approx(7.0)
    np.testing.assert_array_equal(scaled[:, pip], trial.truth.angles_rad[:, pip])
    np.testing.assert_array_equal(scaled[0], trial.truth.angles_rad[0])


def test_frames_are_lost_in_bursts_of_the_share_asked_for() -> None:
    lost = bursts(np.random.default_rng(0), 24_000, 16, 0.4)
    assert lost.mean() == pytest.approx(0.4, abs=0.03)
    assert np.diff(lost, axis=0).mean() < 0.02
    half = record(0, "right", Scenario("half", half_absent=True), N).poses
    assert sorted(half.valid.mean(0))[:2] == [0.5, 1.0]
    assert np.isnan(half.position_mm[~half.valid]).all()


def test_twice_misplaced_is_twice_as_far(trial: Trial) -> None:
    far = record(3, "left", Scenario("far", realism=Realism(mounts=2.0)), N).truth.mounts
    own = trial.truth.mounts
    np.testing.assert_allclose(angle(far.quaternion), 2 * angle(own.quaternion), rtol=1e-9)
    lateral = own.segments.index("index_middle"), 1  # whose nominal place is 0
    assert far.position_mm[lateral] == pytest.approx(2 * own.position_mm[lateral])


def test_a_told_length_is_a_share_of_the_true_one(trial: Trial) -> None:
    told = record(3, "left", Scenario("told", told_length=0.9), N).hand_length_mm
    assert told == pytest.approx(0.9 * true_length_mm(trial.truth.hand))
    assert 130 < true_length_mm(trial.truth.hand) < 220


def test_poses_of_markers_without_error_are_exact() -> None:
    rng = np.random.default_rng(1)
    turn = matrix(about_axis(unit(rng.standard_normal((20, 3))), rng.uniform(0, 3, 20)))
    place = rng.normal(0, 50, (20, 3))
    markers = place[:, None] + literature.MARKERS_MM @ np.swapaxes(turn, -1, -2)
    found = literature.rigid_poses(literature.MARKERS_MM, markers)
    np.testing.assert_allclose(found[0], turn, atol=1e-12)
    np.testing.assert_allclose(found[1], place, atol=1e-10)


@pytest.mark.parametrize("hinge", [True, False])
def test_the_protocols_joint_is_one(hinge: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without noise both clusters see the same fixed centre, and the joint turns by its range."""
    monkeypatch.setattr(literature, "NOISE_MM", 0.0)
    made = literature.two_segments(np.random.default_rng(2), "both", 40.0, hinge=hinge)
    (parent, child), (a_mm, b_mm) = (
        np.swapaxes(x, 0, 1) for x in (made.poses.quaternion, made.poses.position_mm)
    )
    from_parent = a_mm + rotate(parent, np.array([literature.CENTRE_MM, 0.0, 0.0]))
    np.testing.assert_allclose(from_parent, b_mm + rotate(child, made.centre_child_mm), atol=1e-9)
    bent = multiply(conjugate(parent), child)
    assert np.degrees(angle(bent)).max() == pytest.approx(20.0, abs=1.0)
    across = bent[:, 1:] @ Z
    assert (np.abs(across).max() < 1e-9) == hinge
    assert literature.axis_distance_mm(made, made.centre_child_mm + 7 * Y + 3 * Z, Y) == pytest.approx(3.0)


def test_more_range_is_more_accurate() -> None:
    little, much = (literature.protocol_row("both", deg, 5, 0) for deg in (10.0, 90.0))
    assert much.centre_mm < little.centre_mm / 2
    assert much.axis_mm < little.axis_mm / 2
    assert math.isnan(much.peer_centre_mm)


def test_inertial_signals_are_those_of_the_motion() -> None:
    """Turning at 2 rad/s about a tilted axis 100 mm away: that rate, gravity, and the pull to the axis."""
    time_s = np.arange(200) / RATE_HZ
    axis = unit(np.array([0.0, 0.3, 1.0]))
    turn = about_axis(axis, 2.0 * time_s)[:, None]
    arm = unit(np.cross(axis, X))
    place = 100 * rotate(turn, arm)
    poses = Poses(("a",), np.arange(200), time_s, place, turn, np.ones((200, 1), bool))
    gyr, acc = peers.inertial(poses)
    np.testing.assert_allclose(gyr[:, 0], np.tile(2 * axis, (len(gyr), 1)), atol=1e-9)
    gravity = rotate(conjugate(turn[12:-12]), np.array([0.0, 0.0, peers.GRAVITY_M_S2]))
    np.testing.assert_allclose(acc - gravity, np.broadcast_to(-0.4 * arm, acc.shape), atol=2e-3)


def made_up(estimator: str, off_mm: float) -> HandScore:
    joints = [name for members in JOINT_TYPES.values() for name in members]
    errors = tuple(JointError(name, off_mm, 0.0, off_mm, 3.0, 1.0, 0.5) for name in joints)
    return HandScore(estimator, errors, (BoneError("index_proximal", -2.0, 1.0),), (1.5,), 0.5)


def test_a_person_is_scored_hand_by_hand() -> None:
    wanted = (estimators.PAPER, estimators.ANATOMICAL, estimators.WHOLE, estimators.BOTH)
    found = person_result(3, FULL, wanted, N)
    assert sorted(one.estimator for one in found.scores) == sorted(2 * wanted)
    for one in found.scores:
        assert len(one.joints) == 15
        assert all(np.isfinite(joint.child_mm) for joint in one.joints)
        assert {*PHALANGES} <= {bone.bone for bone in one.bones}
    right, left = (one for one in found.scores if one.estimator == estimators.WHOLE)
    assert right.palm_deg != left.palm_deg
    assert all(0 < degrees < 20 for degrees in (*right.palm_deg, *left.palm_deg))
    assert {tip.digit for tip in found.tips} == {"thumb", "index", "middle", "ring", "little"}
    true, fitted = (
        np.mean([tip.mean_mm for tip in found.tips if tip.skeleton == skeleton])
        for skeleton in (TRUE, estimators.WHOLE)
    )
    assert true < fitted
    assert len(accuracy_tables.tip_table(found.tips, "one person").rows) == 9
    whole, skin, touched, _ = (row[2] for row in accuracy_tables.tip_targets(found.tips))
    assert isinstance(whole, float)
    assert isinstance(touched, float)
    assert skin is not None
    assert touched < whole


def test_every_estimator_has_a_row_and_a_missing_peer_its_reason() -> None:
    names = (*estimators.OURS, peers.SCORE)
    scores = {name: [made_up(name, 2.0 + 2.0 * (name == peers.SCORE))] for name in names}
    table = accuracy_tables.estimator_table(FULL.name, scores, {peers.QMT: "as this test says"}, "one person")
    assert [row[0] for row in table.rows] == [*names, peers.QMT]
    assert [row[-1] for row in table.rows] == [0.5] * len(estimators.OURS) + [1.0, None]
    assert "as this test says" in table.meaning
    by_scenario = {FULL.name: scores, STIFF.name: scores, FOREIGN.name: scores}
    assert len(accuracy_tables.sweep_table([FULL.name, FOREIGN.name], by_scenario, "one person").rows) == 2
    ablated = {name: [made_up(name, 1.0)] for name in (estimators.WHOLE, *estimators.ABLATIONS)}
    assert [row[1] for row in accuracy_tables.ablation_table(ablated, "one person").rows] == [1.0] * len(
        ablated
    )


def test_of_several_scenarios_the_worst_is_held_to_the_target() -> None:
    names = estimators.OURS
    by_scenario = {key.name: {name: [made_up(name, 1.0)] for name in names} for key in BY_KEY.values()}
    by_scenario["xray"] = {name: [made_up(name, 2.0)] for name in names}
    found = {row[0]: row for row in accuracy_tables.targets(by_scenario)}
    assert found["whole-hand, xray: median mm"][2:] == (2.0, "NO")
    assert found["whole-hand, other-anatomy: median mm"][2:] == (1.0, "yes")
    assert found["whole-hand, blend: in ellipsoid %"][2] == 50.0
    table = accuracy_tables.target_table(list(found.values()), "one person")
    assert sum("in radius %" in str(row[0]) for row in table.rows) == len(BY_KEY)


def test_scenarios_stand_side_by_side() -> None:
    """Every scenario and estimator has a row; lengths have a sign, and a kind without a bone has no mean."""
    shown = (estimators.PAPER, estimators.WHOLE)
    scores = {key: {name: [made_up(name, 2.0)] for name in shown} for key in BY_KEY}
    table = accuracy_tables.scenario_table(scores, shown, "one person")
    assert [row[:2] for row in table.rows] == [(key, name) for key in BY_KEY for name in shown]
    assert table.rows[0][2:7] == (1, 2.0, 2.0, 0.0, 100.0)
    lengths = accuracy_tables.length_table(scores, shown, "one person")
    assert lengths.rows[0][2:] == (-2.0, None, -2.0, None, None, 100.0)


def test_directions_are_told_apart_by_type_of_joint() -> None:
    """Of a hinge motion shows what is across its axis, of another joint everything."""
    shown = (estimators.WHOLE,)
    table = accuracy_tables.direction_table(
        {estimators.WHOLE: [made_up(estimators.WHOLE, 2.0)]}, shown, "one"
    )
    shows = {row[0]: row[2] for row in table.rows}
    assert {kind for kind, shown in shows.items() if shown == "across"} == {"thumb IP", "PIP", "DIP"}
    assert table.rows[0][3:] == (0.0, 0.0, 2.0, 2.0, 2.0, 2.0)


def test_a_tracker_with_faults_is_read_as_any_is() -> None:
    """Lost poses are gaps; of spikes and positions from the wrong side few are left."""
    faulty, sound = (record(3, "right", BY_KEY[key], N) for key in ("faults", "blend"))
    np.testing.assert_array_equal(faulty.truth.bone_position_mm, sound.truth.bone_position_mm)
    assert 0.9 < faulty.poses.valid.mean() < 0.995
    off = np.linalg.norm(faulty.poses.position_mm - sound.poses.position_mm, axis=-1)[faulty.poses.valid]
    assert (off > 30).mean() < 0.002


def test_without_noise_and_skin_receivers_ride_on_their_bones() -> None:
    made = record(3, "right", CLEAN, N)
    position, _ = made.truth.mounts.poses(made.truth.bone_position_mm, made.truth.bone_quaternion)
    np.testing.assert_array_equal(made.poses.position_mm, position)
    assert angle(made.truth.mounts.quaternion).max() > 0.01


@pytest.mark.parametrize(
    ("text", "said"), [("ct,blood", "'blood' is no scenario"), ("", "'' is no scenario")]
)
def test_an_unknown_scenario_is_refused(text: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    accuracy.add_options(parser)
    assert parser.parse_args(["--scenarios", "ct,blend"]).scenarios == [BY_KEY["ct"], FULL]
    with pytest.raises(SystemExit):
        parser.parse_args(["--scenarios", text])
    assert said in capsys.readouterr().err


def test_the_figure_names_every_scenario_and_is_the_same_twice() -> None:
    scores = {name: summary([made_up(name, 2.0)]) for name in estimators.OURS}
    by_scenario = dict.fromkeys((FULL.name, STIFF.name, FOREIGN.name), scores)
    drawn = accuracy_figure.draw(by_scenario, "x & y")
    texts = [text.text for text in ElementTree.fromstring(drawn).iter("{http://www.w3.org/2000/svg}text")]
    assert {estimators.WHOLE, FULL.name, FOREIGN.name} < set(texts)
    assert any("x & y" in str(text) for text in texts)
    assert accuracy_figure.draw(by_scenario, "x & y") == drawn


def test_parts_are_left_out_of_the_fit(trial: Trial) -> None:
    """A fit without skin states is another one, and one with nothing wanted is none."""
    name = "without skin states"
    fits = estimators.whole_hands([trial], [name])
    assert list(fits) == [name]
    names = fits[name][0][0].evidence.model.unknowns.names
    assert not any(" tilt " in unknown for unknown in names)
    assert estimators.whole_hands([trial], []) == {}


def test_joints_that_do_not_count_are_left_out() -> None:
    dips = person_result(3, Scenario("dips", counted="_dip"), (estimators.PAPER,), N)
    assert [len(one.joints) for one in dips.scores] == [4, 4]


@pytest.mark.parametrize(
    ("measured", "limits", "kept"),
    [(2.0, (2.0,), "yes"), (2.1, (2.0,), "NO"), (92.0, (98.0, 93.0), "NO"), (None, (1.0,), None)],
)
def test_a_target_is_kept_or_not(measured: float | None, limits: tuple[float, ...], kept: object) -> None:
    assert accuracy_tables.target_row("a", measured, *limits)[3] == kept


@pytest.mark.skipif(peers.missing_peers() != peers.NOT_RUN, reason="published software is not installed")
def test_peers_estimate_a_hand(trial: Trial) -> None:
    for name, n_joints in ((peers.SCORE, 15), (peers.SARA, 15), (peers.QMT, 9)):
        found = score(name, trial, estimators.published(trial, name, 2))
        assert len(found.joints) == n_joints
