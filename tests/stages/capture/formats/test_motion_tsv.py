"""Reading Motion-BIDS of whoever wrote it: units, Euler angles, gaps, times, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files
import yaml
from recording_files import LIBERTY
from scipy.spatial.transform import Rotation

from shukotsu.skeleton.rotations import matrix
from shukotsu.stages.capture.inspect_file import describe
from shukotsu.stages.capture.samples import Samples

STEM = "sub-01_task-rom_tracksys-right"
HEADER = "name component type tracked_point units reference_frame"
QUATERNION = ("quat_x", "quat_y", "quat_z", "quat_w")


def channel_rows(
    point: str, unit: str = "m", orientation: tuple[str, ...] = QUATERNION, turn: str = "n/a"
) -> str:
    rows = [f"{point}_{axis} {axis} POS {point} {unit} lab" for axis in "xyz"]
    rows += [f"{point}_{axis} {axis} ORNT {point} {turn} lab" for axis in orientation]
    return "\n".join(rows)


LATENCY = "latency n/a LATENCY n/a s n/a"
CHANNELS = "\n".join([HEADER, LATENCY, channel_rows("hand"), channel_rows("index_distal", "mm")])
ROWS = [
    "0.000000 0.1 -0.02 0.3 0 0.8 0 0.6 10 20 30 0 0 0 1",
    "0.004167 0.125 -2e-2 .3 0 0.8 0 0.6 n/a n/a n/a n/a n/a n/a n/a",
]
MOTION = "\n".join(ROWS) + "\n"
OWN = "Shukotsu"
SIDECAR = {"TaskName": "rom", "SamplingFrequency": 240}


def write(
    folder: Path,
    motion: str | bytes = MOTION,
    channels: str | bytes = CHANNELS,
    sidecar: object = SIDECAR,
    frame: object = None,
) -> Path:
    """A recording's files; blanks become tabs."""
    for name, text in {"motion": motion, "channels": channels}.items():
        data = text if isinstance(text, bytes) else text.replace(" ", "\t").encode()
        (folder / f"{STEM}_{name}.tsv").write_bytes(data)
    (folder / f"{STEM}_motion.json").write_text(sidecar if isinstance(sidecar, str) else json.dumps(sidecar))
    levels = {"reference_frame": {"Levels": {"lab": frame}}}
    (folder / f"{STEM}_channels.json").write_text(json.dumps(levels if frame else {}))
    return folder / f"{STEM}_motion.tsv"


def read(path: Path, mapping: dict[str, object] | None = None) -> Samples:
    return recording_files.read(path, LIBERTY, mapping)


def refuse(path: Path, message: str, mapping: dict[str, object] | None = None) -> None:
    recording_files.refuse(path, message, LIBERTY, mapping)


def test_units_gaps_and_times_by_channel(tmp_path: Path) -> None:
    """Metres are shifted in the text: 0.1 m is 100 mm to the last bit, and so is 2e-2."""
    path = write(tmp_path)
    samples = read(path)
    assert [samples.segments[i] for i in samples.segment] == ["hand"] * 2 + ["index_distal"] * 2
    np.testing.assert_array_equal(samples.frame, [0, 1] * 2)
    np.testing.assert_array_equal(samples.time_s, [0, 0.004167] * 2)
    np.testing.assert_array_equal(samples.numbers[0], [100, -20, 300, 0.6, 0, 0.8, 0])
    np.testing.assert_array_equal(samples.numbers[1, :3], [125, -20, 300])
    np.testing.assert_array_equal(samples.numbers[2], [10, 20, 30, 1, 0, 0, 0])
    assert np.isnan(samples.numbers[3]).all()
    assert samples.place(3) == f"{path}: line 2"


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "XZY", "YXZ"])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_euler_angles_turn_about_fixed_axes(tmp_path: Path, order: str, unit: str) -> None:
    """RotationOrder is extrinsic: XYZ is R = Rz Ry Rx, as of an independent program."""
    angles = {"x": 0.3, "y": -0.7, "z": 1.9}
    told = {axis: angle if unit == "rad" else np.degrees(angle) for axis, angle in angles.items()}
    channels = f"{HEADER}\n{channel_rows('hand', orientation=('z', 'x', 'y'), turn=unit)}"
    frame = {"RotationOrder": order, "RotationRule": "right-hand", "SpatialAxes": "ARI"}
    path = write(tmp_path, f"1 2 3 {told['z']} {told['x']} {told['y']}\n", channels, frame=frame)
    expected = Rotation.from_euler(order.lower(), [angles[axis.lower()] for axis in order]).as_matrix()
    np.testing.assert_allclose(matrix(read(path).numbers[0, 3:]), expected, atol=1e-14)


MAPPING = {
    "format": "motion-bids",
    "position_unit": "m",
    "receivers": {"thumb_distal": {"tracked_point": "hand"}},
}


def test_a_mapping_names_segments_and_leaves_points_out(tmp_path: Path) -> None:
    path = write(tmp_path)
    samples = read(path, {**MAPPING, "fixed": ["forearm"]})
    assert [samples.segments[i] for i in samples.segment] == ["thumb_distal"] * 2 + ["forearm"] * 2
    np.testing.assert_array_equal(samples.numbers[2], [0, 0, 0, 1, 0, 0, 0])
    inverse = {"kind": "quaternion", "order": "xyzw", "rotates": "transmitter-to-receiver"}
    np.testing.assert_array_equal(
        read(path, {**MAPPING, "orientation": inverse}).numbers[0, 3:], [0.6, 0, -0.8, 0]
    )
    refuse(path, "position_unit: is mm, but .*tracked point hand has m;", {**MAPPING, "position_unit": "mm"})
    odd = {**MAPPING, "receivers": {"hand": {"tracked_point": "Hand"}}}
    refuse(path, "'Hand' is not in .*_channels.tsv, which has hand, index_distal; did you mean 'hand'", odd)
    refuse(path, "has no tracked_point", {**MAPPING, "receivers": {"hand": {}}})


def test_a_draft_says_what_the_file_does_not(tmp_path: Path) -> None:
    """No order of angles, a unit that is none, and names that differ by what a segment may not have."""
    channels = "\n".join(
        [HEADER, channel_rows("Hand", "feet", ("x", "y", "z"), "deg"), channel_rows("hand-", "feet")]
    )
    draft = yaml.safe_load(describe(write(tmp_path, channels=channels), LIBERTY).draft)
    assert draft["position_unit"] == "CHECK"
    assert draft["orientation"] == {"kind": "euler", "axes": "CHECK", "unit": "deg"}
    assert draft["receivers"] == {"hand": {"tracked_point": "Hand"}, "hand_2": {"tracked_point": "hand-"}}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("index_distal", "indx_distal", "segment 'indx_distal' is not in layout liberty16.*did you mean"),
        ("hand_x x POS hand m", "hand_x x POS hand feet", "hand_x: units: is 'feet'; expected mm or cm or m"),
        ("latency n/a LATENCY n/a s", "latency n/a LATENCY n/a min", "channel latency: units: is 'min'"),
        ("hand_x x POS", "hand_x x VEL", "tracked point hand: has no POS channels of component x"),
        ("hand_y y POS", "hand_y x POS", "tracked point hand: has 2 POS channels of component x"),
        ("quat_w ORNT hand", "n/a ORNT hand", "no ORNT channels of component quat_w"),
        ("tracked_point", "point", "tracked_point is missing; found name"),
        ("hand_x x POS hand m lab", "hand_x x POS hand m", "line 3: has 5 cells; expected 6 as in"),
        ("hand_x x POS hand m lab", "hand_x x POS hand m room", "is room, lab; expected one"),
        ("latency n/a LATENCY n/a s n/a\n", "", "line 1: has 15 cells; expected 14"),
        ("hand_x x POS hand m lab", "other n/a LATENCY n/a s n/a", "has no POS channels of component x"),
        ("\nhand_x", "\nother n/a LATENCY n/a s n/a\nhand_x", "tracked point hand: has 2 LATENCY channels"),
    ],
)  # fmt: skip
def test_channels_that_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in CHANNELS
    refuse(write(tmp_path, channels=CHANNELS.replace(old, new)), message)


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"motion": ""}, "_motion.tsv: has no rows"),
        ({"motion": "\n\n"}, "_motion.tsv: has no rows"),
        (
            {"motion": MOTION.replace("0.125", "left")},
            "line 2, column 2 (hand_x): is 'left'; expected a numb",
        ),
        (
            {"motion": MOTION.replace("0.125", "inf")},
            "line 2, column 2 (hand_x): is 'inf'; expected a number",
        ),
        ({"motion": MOTION.replace("0.125", "0,125")}, "is '0,125'; expected a number"),
        ({"motion": "\n" + MOTION.replace("0.125", "left")}, "line 3, column 2"),
        ({"motion": MOTION.replace(" 0.125", "")}, "line 2: has 14 cells; expected 15"),
        ({"motion": MOTION.encode().replace(b" ", b"\t") + b"\xff\xfe"}, "line 3: is not UTF-8 text"),
        ({"frame": {"SpatialAxes": "ARS"}}, "lab is not right-handed (SpatialAxes ARS"),
        ({"frame": {"RotationRule": "left-hand"}}, "lab is not right-handed (RotationRule 'left-hand'"),
        ({"sidecar": "{"}, "_motion.json: is not valid JSON"),
        ({"sidecar": "[1]"}, "_motion.json: holds no JSON object"),
        ({"sidecar": {OWN: {"FrameChannel": "counter"}}}, "FrameChannel: names the channel 'counter'"),
        (
            {"sidecar": {OWN: {"FrameChannel": "hand_x"}}},
            "line 1, column 2 (hand_x): is '0.1'; expected a wh",
        ),
        ({"sidecar": {OWN: {"TimeChannels": []}}}, "TimeChannels: is .*; expected an object"),
        ({"sidecar": {OWN: {"FlagBits": ["odd"]}}}, "FlagBits: is .*; expected a list of flags"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, files: dict[str, Any], message: str) -> None:
    refuse(write(tmp_path, **files), message)
