"""Every mistake that is planted in a hand is named, with what to write; a hand without one is left alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_poses import hand_of

from benchmarks.faultless_hands import Planted, changed, exchanged, faultless, other_hand
from benchmarks.mistakes import MISTAKES
from shukotsu.checks.checked_recording import check_recording
from shukotsu.checks.declared import Declared
from shukotsu.hand.rotations import conjugate, from_matrix, matrix, multiply
from shukotsu.readers.formats.readers import find_parts_reader
from shukotsu.readers.samples import joined
from shukotsu.study.config_files import config_path, read_config
from shukotsu.study.findings import SUSPECT
from shukotsu.study.layout import layout_from_config, read_layout
from shukotsu.tables.poses import Poses

LAYOUT = read_layout("liberty16")


ALIKE = {
    "centimetres read as mm",
    "inches read as cm",
    "degrees read as radians",
    "seconds read as milliseconds",
    "neighbours on the thumb",
    "neighbouring fingers",
    "axes in another order",
    "a receiver by 90 deg",
}
"""Of these another one of the same kind is tried every time."""


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=[pytest.mark.slow] * (one in ALIKE)) for one in MISTAKES]
)
def test_a_planted_mistake_is_named_alone(planted: Planted, name: str) -> None:
    kind, mistake = MISTAKES[name]
    findings = mistake(planted, np.random.default_rng(3)).findings()
    assert [finding.kind for finding in findings] == [kind]
    assert findings[0].message.endswith(".")
    assert "; " in findings[0].message


@pytest.mark.slow
@pytest.mark.parametrize("hand", ["left", "right"])
def test_odd_hands_are_no_mistakes(hand: str) -> None:
    """Of either drawing, however the receiver over the thumb's metacarpal faces."""
    for drawing, name, own in faultless(8, hand, np.random.default_rng(8)):
        assert own.findings() == [], (drawing, name)


@pytest.mark.parametrize(
    "name",
    [
        "inverse rotations",
        pytest.param("x, y, z, w read as w, x, y, z", marks=pytest.mark.slow),
        pytest.param("a receiver by 180 deg", marks=pytest.mark.slow),
    ],
)
def test_a_mistake_in_a_hand_drawn_otherwise_is_named(name: str) -> None:
    kind, mistake = MISTAKES[name]
    findings = mistake(other_hand(3, "left", "rom"), np.random.default_rng(3)).findings()
    assert [finding.kind for finding in findings] == [kind]


def test_a_cure_is_never_what_stands_there_already(planted: Planted) -> None:
    """The other sense, the other order and another unit than the mapping's own."""
    declared = Declared("csv", position_unit="cm", order="xyzw", rotates="transmitter-to-receiver")
    other_order = MISTAKES["w, x, y, z read as x, y, z, w"][1]
    plant = {
        "write `rotates: receiver-to-transmitter`": MISTAKES["inverse rotations"][1],
        "write `order: wxyz`": lambda own, rng: inverted(other_order(inverted(own), rng)),
        "write `position_unit: m`": lambda own, _: changed(own, position_mm=own.poses.position_mm / 100),
    }
    for cure, mistake in plant.items():
        wrong = replace(mistake(planted, np.random.default_rng(1)), declared=declared)
        (finding,) = wrong.findings()
        assert cure in finding.message


def inverted(planted: Planted) -> Planted:
    return changed(planted, quaternion=conjugate(planted.poses.quaternion))


def test_a_sentence_says_what_is_seen_and_what_to_write(planted: Planted) -> None:
    (swapped,) = replace(
        planted, poses=exchanged(planted.poses, ("index_proximal", "index_middle"))
    ).findings()
    assert swapped.message.startswith("The receivers index_proximal and index_middle seem to be swapped (")
    assert "put right" in swapped.message
    assert swapped.message.endswith("in the layout: index_proximal with index_middle.")
    small = replace(planted.poses, position_mm=planted.poses.position_mm / 1000)
    (metres,) = replace(planted, poses=small).findings()
    assert "in m and are read as mm, a factor of 1000 off (the hand comes out 0.01 times" in metres.message
    assert "multiply x_mm, y_mm and z_mm by 1000 in the file" in metres.message
    (mapped,) = replace(planted, poses=small, declared=Declared("csv")).findings()
    assert "write `position_unit: m` in the mapping" in mapped.message


def test_receivers_that_the_layout_has_turned_are_right(planted: Planted) -> None:
    """The hand's receiver sits with x to the side, and the layout says so; then swapped with another."""
    config = read_config(config_path("liberty16", "layout", Path()), "layout")
    config["segments"]["hand"]["receiver_axes"] = {"distal": [0, 1, 0], "lateral": [-1, 0, 0]}
    layout = layout_from_config(config, "turned")
    axes = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], float)  # columns: distal, lateral, dorsal
    quaternion = planted.poses.quaternion.copy()
    quaternion[:, 0] = multiply(quaternion[:, 0], from_matrix(axes.T))
    poses = replace(planted.poses, quaternion=quaternion)
    assert check_recording(poses, layout, "right").findings == ()
    (finding,) = check_recording(poses, LAYOUT, "right").findings
    assert finding.kind == "receiver-turned"
    assert "under the segment hand in the layout" in finding.message
    assert "distal: [0, 1, 0]" in finding.message
    assert "dorsal: [0, 0, 1]" in finding.message


def test_a_left_hand_taken_for_a_right_one_is_mirrored() -> None:
    (finding,) = replace(hand_of(9, "left"), hand="right").findings()
    assert finding.kind == "wrong-hand"
    assert "--hand left" in finding.message


def test_what_no_receiver_can_be_is_named_alone(planted: Planted) -> None:
    """Zeros of all receivers close every joint, and a receiver that is given twice its own."""
    position, quaternion = planted.poses.position_mm.copy(), planted.poses.quaternion.copy()
    position[300:500], quaternion[300:500] = 0, [1, 0, 0, 0]
    empty = replace(planted.poses, position_mm=position, quaternion=quaternion)
    (finding,) = check_recording(empty, LAYOUT, "right").findings
    assert (finding.kind, finding.severity) == ("zeros", SUSPECT)
    assert "number: 3200" in finding.message
    middle, distal = (planted.poses.index(f"index_{bone}") for bone in ("middle", "distal"))
    position, quaternion = planted.poses.position_mm.copy(), planted.poses.quaternion.copy()
    position[:, middle], quaternion[:, middle] = position[:, distal], quaternion[:, distal]
    twice = replace(planted.poses, position_mm=position, quaternion=quaternion)
    (finding,) = check_recording(twice, LAYOUT, "right").findings
    assert (finding.kind, finding.severity) == ("receivers-alike", SUSPECT)
    assert "index_middle and index_distal have one and the same pose in 100 %" in finding.message


def test_sides_that_nothing_decides_are_said_and_no_repair_is_asked_for(planted: Planted) -> None:
    position = planted.poses.position_mm.copy()
    position[400:, planted.poses.index("ring_distal")] *= -1
    flipped = replace(planted.poses, position_mm=position)
    (asked,) = check_recording(flipped, LAYOUT, "right").findings
    assert (asked.kind, asked.severity) == ("hemisphere", SUSPECT)
    assert "`repair`" in asked.message
    left_out = {"hemisphere-undecided": {"ring_distal": 900}}
    (said,) = check_recording(flipped, LAYOUT, "right", left_out=left_out).findings
    assert (said.kind, said.severity) == ("hemisphere", SUSPECT)
    assert said.message.startswith("Poses are of a receiver that was on both sides")
    assert "(ring_distal: 900)" in said.message
    assert "`repair`" not in said.message


# --- layouts that are no hand -----------------------------------------------------------------------------


def arm_poses(real_data: Path, side: str) -> Poses:
    path = real_data / "upper_limb_poses" / f"racing_{side}.csv"
    layout = read_layout("arm")
    samples = joined(find_parts_reader(path, "auto", None)(path, layout, None))
    shape = (-1, len(layout.measured))
    order = np.lexsort((samples.segment, samples.frame))
    numbers = samples.numbers[order].reshape(*shape, 7)
    valid = np.isfinite(numbers).all(-1)
    frame, time_s = (array[order].reshape(shape)[:, 0] for array in (samples.frame, samples.time_s))
    return Poses(layout.measured, frame, time_s, numbers[..., :3], numbers[..., 3:], valid)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_real_arm(real_data: Path, side: str) -> None:
    arm = Planted(arm_poses(real_data, side), side)
    layout = read_layout("arm")
    assert check_recording(arm.poses, layout, side).findings == ()
    for name in (
        "x, y, z, w read as w, x, y, z",
        "inverse rotations",
        "metres read as mm",
        "one axis negated",
        "axes in another order",
    ):
        kind, mistake = MISTAKES[name]
        wrong = mistake(arm, np.random.default_rng(4)).poses
        findings = check_recording(wrong, layout, side).findings
        assert [(one.kind, one.severity) for one in findings] == [(kind, SUSPECT)], name


def test_the_world_has_no_preferred_direction(planted: Planted) -> None:
    turn = np.array([0.5, -0.5, 0.5, 0.5])
    poses = planted.poses
    turned = replace(
        poses, position_mm=poses.position_mm @ matrix(turn).T, quaternion=multiply(turn, poses.quaternion)
    )
    here, there = (check_recording(own, LAYOUT, "right").explanation for own in (poses, turned))
    assert here is not None
    assert there is not None
    np.testing.assert_allclose(there.total[0], here.total[0], atol=1e-6)
    np.testing.assert_allclose(there.centre_mm[0], here.centre_mm[0], atol=1e-6)
