"""Reading Motion-BIDS of whoever wrote it: units, Euler angles, gaps, times, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kinematics.rotations import matrix
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.mapping import mapping_from_config
from stages.capture.formats.motion_bids import describe, draft_mapping, read_motion_bids
from stages.capture.formats.readers import find_reader
from stages.capture.samples import ReadingOptions, Samples

LIBERTY = read_layout("liberty16")
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
    options = ReadingOptions(None if mapping is None else mapping_from_config(mapping, "mapping.yaml"))
    return read_motion_bids(path, LIBERTY, options)


def refuse(path: Path, message: str, mapping: dict[str, object] | None = None) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(path, mapping)
    assert "\n" not in str(caught.value)


def test_units_gaps_and_times_by_channel(tmp_path: Path) -> None:
    """Metres are shifted in the text: 0.1 m is 100 mm to the last bit, and so is 2e-2."""
    path = write(tmp_path)
    samples = find_reader(path, "auto")(path, LIBERTY, ReadingOptions())
    assert [samples.segments[i] for i in samples.segment] == ["hand"] * 2 + ["index_distal"] * 2
    np.testing.assert_array_equal(samples.frame, [0, 1] * 2)
    np.testing.assert_array_equal(samples.time_s, [0, 0.004167] * 2)
    np.testing.assert_array_equal(samples.numbers[0], [100, -20, 300, 0.6, 0, 0.8, 0])
    np.testing.assert_array_equal(samples.numbers[1, :3], [125, -20, 300])
    np.testing.assert_array_equal(samples.numbers[2], [10, 20, 30, 1, 0, 0, 0])
    assert np.isnan(samples.numbers[3]).all()
    assert samples.place(3) == f"{path}: line 2"


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n\n"])
def test_lines_may_end_as_they_like(tmp_path: Path, end: str) -> None:
    plain = read(write(tmp_path))
    found = read(write(tmp_path, "\ufeff" + MOTION.replace("\n", end), CHANNELS.replace("\n", "\r\n")))
    np.testing.assert_array_equal(found.numbers, plain.numbers)


def test_without_latency_times_are_counted_by_the_sampling_frequency(tmp_path: Path) -> None:
    motion = MOTION.replace("0.000000 ", "").replace("0.004167 ", "")
    path = write(tmp_path, motion, CHANNELS.replace(LATENCY + "\n", ""))
    np.testing.assert_array_equal(read(path).time_s, [0, 1 / 240] * 2)
    path = write(tmp_path, motion, CHANNELS.replace(LATENCY + "\n", ""), {"TaskName": "rom"})
    refuse(path, "no LATENCY channel and its motion.json no SamplingFrequency")
    assert read(path, {**MAPPING, "rate_hz": 100}).time_s[1] == 0.01


@pytest.mark.parametrize("order", ["XYZ", "ZYX", "XZY", "YXZ"])
@pytest.mark.parametrize("unit", ["rad", "deg"])
def test_euler_angles_turn_about_fixed_axes(tmp_path: Path, order: str, unit: str) -> None:
    """RotationOrder is extrinsic: XYZ is R = Rz Ry Rx, as of an independent program."""
    angles = {"x": 0.3, "y": -0.7, "z": 1.9}
    told = {axis: angle if unit == "rad" else np.degrees(angle) for axis, angle in angles.items()}
    channels = f"{HEADER}\n{channel_rows('hand', orientation=('z', 'x', 'y'), turn=unit)}"
    frame = {"RotationOrder": order, "RotationRule": "right-hand", "SpatialAxes": "ARI"}
    path = write(tmp_path, f"1 2 3 {told['z']} {told['x']} {told['y']}", channels, frame=frame)
    expected = Rotation.from_euler(order.lower(), [angles[axis.lower()] for axis in order]).as_matrix()
    np.testing.assert_allclose(matrix(read(path).numbers[0, 3:]), expected, atol=1e-14)


EULER_CHANNELS = f"{HEADER}\n{channel_rows('hand', orientation=('x', 'y', 'z'), turn='deg')}"


def test_an_order_of_angles_is_never_guessed(tmp_path: Path) -> None:
    """It comes of channels.json or of a mapping, and where both say it they must agree."""
    path = write(tmp_path, "1 2 3 10 20 30", EULER_CHANNELS)
    refuse(path, "has Euler angles, but channels.json gives the reference frame 'lab' no RotationOrder")
    hand = {"format": "motion-bids", "position_unit": "m", "receivers": {"hand": {"tracked_point": "hand"}}}
    azimuth_first = {"kind": "euler", "axes": "ZYX", "unit": "deg"}
    found = read(path, {**hand, "orientation": azimuth_first}).numbers[0, 3:]
    expected = Rotation.from_euler("ZYX", [30, 20, 10], degrees=True).as_matrix()
    np.testing.assert_allclose(matrix(found), expected, atol=1e-14)
    path = write(tmp_path, "1 2 3 10 20 30", EULER_CHANNELS, frame={"RotationOrder": "XYZ"})
    np.testing.assert_array_equal(read(path, {**hand, "orientation": azimuth_first}).numbers[0, 3:], found)
    refuse(
        path,
        "axes: is XYZ, but .* RotationOrder XYZ",
        {**hand, "orientation": {**azimuth_first, "axes": "XYZ"}},
    )
    refuse(path, "units: is 'deg'; expected rad", {**hand, "orientation": {**azimuth_first, "unit": "rad"}})
    refuse(path, "has euler components", {**hand, "orientation": {"kind": "quaternion", "order": "wxyz"}})


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


def test_what_inspect_says_and_drafts(tmp_path: Path) -> None:
    path = write(tmp_path)
    assert "tracked point hand: POS x y z in m; ORNT quat_x quat_y quat_z quat_w in n/a" in describe(path)
    assert "times in the channel latency; SamplingFrequency 240 Hz" in describe(path)
    assert draft_mapping(path) == {
        "format": "motion-bids",
        "position_unit": "m",
        "receivers": {"hand": {"tracked_point": "hand"}, "index_distal": {"tracked_point": "index_distal"}},
    }


def test_a_draft_says_what_the_file_does_not(tmp_path: Path) -> None:
    """No order of angles, a unit that is none, and names that differ by what a segment may not have."""
    channels = "\n".join(
        [HEADER, channel_rows("Hand", "feet", ("x", "y", "z"), "deg"), channel_rows("hand-", "feet")]
    )
    draft = draft_mapping(write(tmp_path, channels=channels))
    assert draft["position_unit"] == "CHECK"
    assert draft["orientation"] == {"kind": "euler", "axes": "CHECK", "unit": "deg"}
    assert draft["receivers"] == {"hand": {"tracked_point": "Hand"}, "hand_2": {"tracked_point": "hand-"}}


def test_sidecars_are_inherited_within_a_dataset_only(tmp_path: Path) -> None:
    """From the dataset's root down, the nearest last; a file of another task does not apply."""
    folder = tmp_path / "sub-01" / "motion"
    folder.mkdir(parents=True)
    motion = MOTION.replace("0.000000 ", "").replace("0.004167 ", "")
    path = write(folder, motion, CHANNELS.replace(LATENCY + "\n", ""), {})
    (folder / f"{STEM}_channels.tsv").rename(tmp_path / "task-rom_channels.tsv")
    (tmp_path / "task-walk_channels.tsv").write_text("name\n")
    (tmp_path / "tracksys-right_motion.json").write_text('{"SamplingFrequency": 10}')
    (tmp_path / "sub-01" / "sub-01_motion.json").write_text('{"SamplingFrequency": 50}')
    refuse(path, f"no {STEM}_channels.tsv lies beside it")
    (tmp_path / "dataset_description.json").write_text("{}")
    assert read(path).time_s[1] == 1 / 50


@pytest.mark.parametrize(("told", "text"), [("-9999", "-9999.0"), (0, "0"), ("gone", "gone"), ("NaN", "NaN")])
def test_missing_values_are_those_that_the_sidecar_names(tmp_path: Path, told: object, text: str) -> None:
    """A number means a gap only where a pose is that number throughout: one coordinate may well be 0."""
    path = write(tmp_path, MOTION.replace("n/a", text), sidecar={**SIDECAR, "MissingValues": told})
    samples = read(path)
    assert np.isnan(samples.numbers[3]).all()
    assert np.isfinite(samples.numbers[:3]).all()


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
    ("motion", "message"),
    [
        ("", "_motion.tsv: is empty"),
        ("\n\n", "_motion.tsv: has no rows"),
        (MOTION.replace("0.125", "left"), r"line 2, column 2 \(hand_x\): is 'left'; expected a number"),
        (MOTION.replace("0.125", "inf"), r"line 2, column 2 \(hand_x\): is 'inf'; expected a number"),
        (MOTION.replace("0.125", "0,125"), "is '0,125'; expected a number"),
        ("\n" + MOTION.replace("0.125", "left"), r"line 3, column 2"),
        (MOTION.replace(" 0.125", ""), "line 2: has 14 cells; expected 15"),
        (MOTION.encode().replace(b" ", b"\t") + b"\xff\xfe", "line 3: has 1 cells; expected 15"),
    ],
)
def test_motion_that_is_refused(tmp_path: Path, motion: str | bytes, message: str) -> None:
    refuse(write(tmp_path, motion), message)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        ({"SpatialAxes": "ARS"}, r"lab is not right-handed \(SpatialAxes ARS"),
        ({"RotationRule": "left-hand"}, r"lab is not right-handed \(RotationRule 'left-hand'"),
    ],
)
def test_left_handed_frames_are_refused(tmp_path: Path, frame: object, message: str) -> None:
    refuse(write(tmp_path, frame=frame), message)
    assert len(read(write(tmp_path, frame={"SpatialAxes": "ALS", "RotationRule": "right-hand"})).frame) == 4


@pytest.mark.parametrize(
    ("sidecar", "message"),
    [
        ("{", "_motion.json: is not valid JSON"),
        ("[1]", "_motion.json: holds no JSON object"),
        ({"Shukotsu": {"FrameChannel": "counter"}}, "FrameChannel: names the channel 'counter'"),
        (
            {"Shukotsu": {"FrameChannel": "hand_x"}},
            r"line 1, column 2 \(hand_x\): is '0.1'; expected a whole number",
        ),
        ({"Shukotsu": {"TimeChannels": []}}, "TimeChannels: is .*; expected an object"),
        ({"Shukotsu": {"FlagBits": ["odd"]}}, "FlagBits: is .*; expected a list of flags"),
    ],
)
def test_sidecars_that_are_refused(tmp_path: Path, sidecar: object, message: str) -> None:
    refuse(write(tmp_path, sidecar=sidecar), message)


def test_files_that_are_not_there_or_not_named_so(tmp_path: Path) -> None:
    refuse(tmp_path / f"{STEM}_motion.tsv", "no such file")
    refuse(tmp_path / "rom.tsv", "expected a name that ends in _motion.tsv")
    path = write(tmp_path)
    (tmp_path / f"{STEM}_channels.tsv").unlink()
    refuse(path, "no sub-01_task-rom_tracksys-right_channels.tsv lies beside it")


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
def test_damaged_bytes_give_samples_or_a_sentence(tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    own = {**SIDECAR, "MissingValues": "0", "Shukotsu": {"FlagBits": ["missing"]}}
    files = [write(tmp_path, sidecar=own, frame={"SpatialAxes": "ALS"})]
    files += [tmp_path / f"{STEM}{ending}" for ending in ("_channels.tsv", "_motion.json", "_channels.json")]
    plain = [path.read_bytes() for path in files]
    read_ok, sentences = 0, []
    for _ in range(500):
        damaged = random.choice(4, p=[0.4, 0.4, 0.15, 0.05])
        data = bytearray(plain[damaged])
        for at in random.integers(len(data), size=random.integers(1, 4)):
            data[at] = random.choice([random.integers(256), 9, 10, ord("0"), data[at] ^ 1])
        files[damaged].write_bytes(bytes(data))
        try:
            read_ok += len(read(files[0]).frame) > 0
        except InputError as error:
            sentences.append(str(error))
        files[damaged].write_bytes(plain[damaged])
    assert 50 < read_ok < 490
    assert not [sentence for sentence in sentences if "\n" in sentence]
