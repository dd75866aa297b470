"""Checks of one recording: every planted mistake is found with its cure, faultless hands have no finding."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sample_files import pose_stream, sequence_of, xdf_header, xdf_of

from benchmarks.faultless_hands import Planted, changed, faultless, other_hand
from benchmarks.mistakes import MISTAKES
from shukotsu.checks.checked_recording import check_recording
from shukotsu.checks.checked_subject import checked_poses
from shukotsu.checks.hypotheses import Declared
from shukotsu.hand.rotations import matrix, multiply
from shukotsu.readers.import_recording import import_for_the_moment
from shukotsu.study.findings import SUSPECT
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import read_poses

LAYOUT = read_layout("liberty16")

OTHERS = ("inverse rotations", "x, y, z, w read as w, x, y, z", "a receiver by 180 deg")
"""Mistakes that are also planted in a hand from a different random model."""
FIRST = {kind: name for name, (kind, _) in reversed(MISTAKES.items())}
"""One mistake of every kind, by kind."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drawn_otherwise"),
    [
        pytest.param(name, otherwise, marks=[] if name in quick else pytest.mark.slow)
        for otherwise, names, quick in ((False, MISTAKES, FIRST.values()), (True, OTHERS, OTHERS[:1]))
        for name in names
    ],
)
def test_a_planted_mistake_is_the_only_finding(planted: Planted, name: str, drawn_otherwise: bool) -> None:
    kind, mistake = MISTAKES[name]
    hand = other_hand(3, "left", "rom") if drawn_otherwise else planted
    findings = mistake(hand, np.random.default_rng(3)).findings()
    assert [finding.kind for finding in findings] == [kind]
    assert findings[0].message.endswith(".")
    assert "; " in findings[0].message


@pytest.mark.parametrize("unit", ["hh:mm:ss", "iso8601"])
def test_implausible_times_of_day_and_dates_are_to_be_scaled(planted: Planted, unit: str) -> None:
    slow = replace(planted.poses, time_s=1000.0 * planted.poses.time_s)
    declared = Declared(format="csv", time_unit=unit)
    (finding,) = check_recording(slow, LAYOUT, "right", declared).findings
    assert (finding.kind, finding.variant) == ("time-unit", "scaled")
    assert "multiply the times by 0.001" in finding.message


@pytest.mark.slow
@pytest.mark.parametrize("hand", ["left", "right"])
def test_unusual_faultless_hands_have_no_finding(hand: str) -> None:
    for drawing, name, faultless_hand in faultless(8, hand, np.random.default_rng(8)):
        assert faultless_hand.findings() == [], (drawing, name)


@pytest.mark.slow
def test_no_repair_is_advised_if_the_hemisphere_is_undecidable(planted: Planted) -> None:
    position = planted.poses.position_mm.copy()
    position[400:, planted.poses.index("ring_distal")] *= -1
    flipped = replace(planted.poses, position_mm=position)
    undecided = {"hemisphere-undecided": {"ring_distal": 900}}
    for left_out, sentence in (({}, "`repair`"), (undecided, "receiver was on both sides")):
        (finding,) = check_recording(flipped, LAYOUT, "right", left_out=left_out).findings
        assert (finding.kind, finding.severity) == ("hemisphere", SUSPECT)
        assert sentence in finding.message
        assert ("`repair`" in finding.message) == (not left_out)


def test_matrices_of_a_sequence_file_are_not_reported_as_quaternions(
    planted: Planted, tmp_path: Path
) -> None:
    """The rotations have other axes than the positions, which looks like another order of quaternions."""
    poses, other = planted.poses, [0, 2, 3, 1]
    numbers = np.concatenate([poses.position_mm, poses.quaternion[..., other]], -1)
    file = sequence_of(poses.segments, numbers[::2])
    (tmp_path / file.path).write_bytes(file.content)
    import_for_the_moment(tmp_path / file.path, "liberty16", "right", tmp_path / "poses.parquet")
    findings = checked_poses(tmp_path / "poses.parquet", LAYOUT).findings
    assert [(finding.kind, finding.variant) for finding in findings] == [("axes-mirrored", "exchanged")]


@pytest.mark.parametrize("mapping", [None, {"format": "logs", "orientation": {"order": "zyxw"}}])
def test_an_order_that_the_reader_defines_is_cured_in_the_file(planted: Planted, mapping: Any) -> None:
    """The file need not have a tidy table's columns, and no key of its mapping would change anything."""
    declared = Declared.of(mapping, "device")
    wrong = changed(planted, quaternion=planted.poses.quaternion[..., [1, 2, 3, 0]])
    (finding,) = replace(wrong, declared=declared).findings()
    assert finding.what == "The quaternions are read as w, x, y, z but seem to be x, y, z, w"
    assert finding.cure == "put the four numbers of each quaternion in the file into the order w, x, y, z"
    assert replace(planted, declared=declared).findings() == []


def test_the_order_in_a_stream_is_cured_by_a_mapping_of_its_own(planted: Planted, tmp_path: Path) -> None:
    poses, path, out = planted.poses, tmp_path / "a.xdf", tmp_path / "poses.parquet"
    numbers = np.concatenate([poses.position_mm / 1000, poses.quaternion[..., [1, 2, 3, 0]]], -1)
    rows = numbers.reshape(len(numbers), -1)
    path.write_bytes(xdf_of(pose_stream(1, xdf_header(poses.segments), poses.time_s, rows)))
    import_for_the_moment(path, "liberty16", "right", out)
    (finding,) = checked_poses(out, LAYOUT).findings
    written = "`kind: quaternion` and `order: xyzw` under `orientation`"
    assert finding.cure == f"write a mapping for the file, with {written}"
    receivers = "".join(f"  {name}: {{value: {name}}}\n" for name in poses.segments)
    text = "format: xdf\nposition_unit: m\norientation: {kind: quaternion, order: xyzw}\nreceivers:\n"
    (tmp_path / "mapping.yaml").write_text(text + receivers)
    import_for_the_moment(path, "liberty16", "right", out, f"--mapping={tmp_path / 'mapping.yaml'}")
    assert checked_poses(out, LAYOUT).findings == ()


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_real_arm_has_no_finding_but_planted_mistakes_do(
    real_data: Path, tmp_path: Path, side: str
) -> None:
    path, layout = real_data / "upper_limb_poses" / f"racing_{side}.csv", read_layout("arm")
    import_for_the_moment(path, "arm", side, tmp_path / "poses.parquet")
    arm = Planted(read_poses(tmp_path / "poses.parquet", layout.measured), side)
    assert check_recording(arm.poses, layout, side).findings == ()
    for name in (*OTHERS[:2], "metres read as mm", "one axis negated", "axes in another order"):
        kind, mistake = MISTAKES[name]
        findings = check_recording(mistake(arm, np.random.default_rng(4)).poses, layout, side).findings
        assert [(finding.kind, finding.severity) for finding in findings] == [(kind, SUSPECT)], name


@pytest.mark.slow
def test_the_check_does_not_depend_on_the_transmitters_orientation(planted: Planted) -> None:
    turn, poses = np.array([0.5, -0.5, 0.5, 0.5]), planted.poses
    position_mm, quaternion = poses.position_mm @ matrix(turn).T, multiply(turn, poses.quaternion)
    turned = replace(poses, position_mm=position_mm, quaternion=quaternion)
    here, there = (check_recording(each, LAYOUT, "right").explanation for each in (poses, turned))
    assert here is not None
    assert there is not None
    np.testing.assert_allclose(there.total[0], here.total[0], atol=1e-6)
    np.testing.assert_allclose(there.centre_mm[0], here.centre_mm[0], atol=1e-6)
