"""Reading XDF 1.0 files, which are written here byte by byte."""

import gzip
import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import recording_files
from sample_files import TYPES, pose_stream, xdf_chunk, xdf_header, xdf_of

from shukotsu.errors import InputError
from shukotsu.readers.samples import Samples
from shukotsu.tables import xdf_streams

Array = npt.NDArray[np.float64]

TIMES = np.array([100.0, 100.004, 100.0075, 100.0125, 100.017])
POSE = np.array([0.1, -0.02, 0.3, 0.6, 0.0, 0.8, 0.0])
VALUES = np.tile([*POSE, *POSE], (5, 1))
VALUES[:, 0] += np.arange(5) / 8
VALUES[3, 7:] = np.nan


def file_of(head: bytes, time_s: Array = TIMES, values: Array = VALUES) -> bytes:
    return xdf_of(pose_stream(1, head, time_s, values))


TWO = ["hand", "index_distal"]
PLAIN = file_of(xdf_header(TWO))


def read(tmp_path: Path, data: bytes, mapping: dict[str, object] | None = None) -> Samples:
    (tmp_path / "rom.xdf").write_bytes(data)
    return recording_files.read(tmp_path / "rom.xdf", mapping=mapping)


def refuse(tmp_path: Path, data: bytes, message: str, mapping: dict[str, object] | None = None) -> None:
    (tmp_path / "rom.xdf").write_bytes(data)
    recording_files.refuse(tmp_path / "rom.xdf", message, mapping=mapping)


def test_a_header_with_expanding_entities_is_refused(tmp_path: Path) -> None:
    names = "abcdefghij"
    entities = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise(names))
    bomb = f'<!DOCTYPE info [<!ENTITY a "0123456789">{entities}]>'.encode()
    head = xdf_header(TWO).replace(b"<name>tracker</name>", b"<name>&j;</name>")
    bombed = xdf_of(pose_stream(1, bomb + head, TIMES, VALUES))
    refuse(tmp_path, bombed, "is damaged: pyxdf cannot read it")


def test_a_file_that_expands_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xdf_streams, "MEMORY_BYTES", 1000)
    refuse(
        tmp_path, gzip.compress(PLAIN + bytes(100_000)), r"more than 0 MB; unpack it with gunzip to an \.xdf"
    )


@pytest.mark.parametrize("field", ["marker", "object"])
def test_poses_times_and_gaps_are_read(tmp_path: Path, field: str) -> None:
    """The file also has a stream of another type; channels are grouped by the field `marker` or `object`."""
    other = pose_stream(9, xdf_header(["eeg"], "cap", "EEG", types=["EEG"]), TIMES, VALUES[:, :1])
    samples = read(tmp_path, xdf_of(other, pose_stream(1, xdf_header(TWO, field=field), TIMES, VALUES)))
    assert [samples.segments[i] for i in samples.segment] == ["hand"] * 5 + ["index_distal"] * 5
    np.testing.assert_array_equal(samples.frame, [*range(5)] * 2)
    np.testing.assert_array_equal(samples.time_s, [*TIMES] * 2)
    np.testing.assert_array_equal(samples.numbers[:5], VALUES[:, :7] * [1000, 1000, 1000, 1, 1, 1, 1])
    np.testing.assert_array_equal(np.isnan(samples.numbers).all(-1), [False] * 8 + [True, False])
    assert samples.locate(9) == f"{tmp_path / 'rom.xdf'}: stream tracker, sample 5"
    assert samples.notes == ()


@pytest.mark.parametrize(
    ("stamps", "offsets", "time_s"),
    [
        ([100, np.nan, 100.5, np.nan, 100.6], [], [100, 100 + 1 / 240, 100.5, 100.5 + 1 / 240, 100.6]),
        (TIMES, [(100.0, -3.0), (100.01, -3.0), (100.02, -3.0)], TIMES - 3),
    ],
    ids=["left-out", "clock-offsets"],
)
def test_missing_times_follow_the_rate_and_clock_offsets_are_applied(
    tmp_path: Path, stamps: Array, offsets: list[tuple[float, float]], time_s: Array
) -> None:
    samples = read(tmp_path, xdf_of(pose_stream(1, xdf_header(TWO), np.array(stamps), VALUES, offsets)))
    np.testing.assert_allclose(samples.time_s[:5], time_s, rtol=0, atol=1e-9)


MAPPING = {
    "format": "xdf",
    "position_unit": "m",
    "receivers": {"hand": {"value": "RB 1"}, "thumb_distal": {"value": "2"}},
}
NAMED = file_of(xdf_header(["RB 1", "2"]))


def test_a_mapping_assigns_markers_to_segments(tmp_path: Path) -> None:
    """It may also use numbers, set the order and direction of quaternions, and name fixed segments."""
    refuse(tmp_path, NAMED, "segment 'RB 1' is not in layout liberty16")
    receivers = {"hand": {"value": "RB 1"}, "thumb_distal": {"value": 2}}
    samples = read(tmp_path, NAMED, {**MAPPING, "receivers": receivers, "fixed": ["forearm"]})
    names = [samples.segments[i] for i in samples.segment]
    assert names == ["hand"] * 5 + ["thumb_distal"] * 5 + ["forearm"] * 5
    np.testing.assert_array_equal(samples.numbers[10], [0, 0, 0, 1, 0, 0, 0])
    orientation = {"kind": "quaternion", "order": "xyzw", "rotates": "transmitter-to-receiver"}
    samples = read(tmp_path, NAMED, {**MAPPING, "orientation": orientation})
    np.testing.assert_array_equal(samples.numbers[0, 3:], [0, -0.6, 0, -0.8])


EULER = [*TYPES[:3], "OrientationP", "OrientationH", "OrientationR"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is not an XDF file"),
        (b"PK\x03\x04", "is not an XDF file"),
        (xdf_of(), "has no stream of type MoCap; it has no stream at all"),
        (file_of(xdf_header(["a"], "cap", "EEG"), TIMES, VALUES[:, :7]), r"it has cap \(EEG\)"),
        (file_of(xdf_header(TWO), TIMES[:0], VALUES[:0]), "has no samples"),
        (file_of(xdf_header(TWO, unit="feet")), "unit: is 'feet'; expected meters"),
        (file_of(xdf_header(TWO, unit="")), "has no unit; set position_unit"),
        (file_of(xdf_header(["hand"], types=EULER), TIMES, VALUES[:, :6]), "has angles"),
        (
            file_of(xdf_header(["hand"], types=TYPES[:6]), TIMES, VALUES[:, :6]),
            "no channels of type OrientationD",
        ),
        (file_of(xdf_header(["hand", "hand"])), "has 2 channels of type PositionX"),
        (file_of(xdf_header(TWO, number="string")), "has format string; expected numbers"),
        (file_of(xdf_header(TWO[:1]).replace(b">7<", b">14<")), "has 14 channels, but its header describes"),
        (PLAIN.replace(b"<nominal_srate>240<", b"<nominal_srate>abc<"), "is damaged: pyxdf cannot read it"),
        (PLAIN.replace(b"<info><name>", b"<info><nome>"), "is damaged: pyxdf cannot read it"),
        (PLAIN.replace(b"<channel_count>14<", b"<channel_count>15<"), "stream tracker: is damaged"),
        (PLAIN + xdf_chunk(2, struct.pack("<I", 1) + xdf_header(TWO)), "a stream begins again"),
        (PLAIN + xdf_chunk(4, struct.pack("<Id", 1, 1.0)), "is damaged: pyxdf cannot read it"),
    ],
)
def test_an_unusable_xdf_file_is_refused_with_the_reason(tmp_path: Path, data: bytes, message: str) -> None:
    refuse(tmp_path, data, message)


@pytest.mark.parametrize("step", [23, pytest.param(3, marks=pytest.mark.slow)])
def test_a_truncated_xdf_file_is_refused_or_read_with_a_note(
    tmp_path: Path, step: int, capfd: pytest.CaptureFixture[str]
) -> None:
    """If it is cut inside a chunk's header it is refused; else the complete samples are read, with a note."""
    whole = read(tmp_path, PLAIN)
    noted = 0
    for length in range(0, len(PLAIN), step):
        try:
            samples = read(tmp_path, PLAIN[:length])
        except InputError:
            continue
        count = len(samples.frame) // 2
        np.testing.assert_array_equal(samples.numbers[:count], whole.numbers[:count])
        noted += samples.notes != ()
    assert noted > 300 // step
    assert capfd.readouterr() == ("", ""), "pyxdf prints nothing"


def test_streams_with_the_same_name_are_selected_by_number(tmp_path: Path) -> None:
    data = xdf_of(*(pose_stream(number, xdf_header(TWO), TIMES + number, VALUES) for number in (4, 7)))
    refuse(
        tmp_path,
        data,
        r"2 streams of type MoCap \(tracker, number 4, tracker, number 7\); select one in a mapping",
    )
    receivers = {segment: {"value": segment} for segment in TWO}
    mapping = {"format": "xdf", "position_unit": "m", "receivers": receivers}
    refuse(
        tmp_path,
        data,
        "has 2 streams of 'tracker'; .* give its number",
        mapping | {"xdf": {"stream": "tracker"}},
    )
    samples = read(tmp_path, data, mapping | {"xdf": {"stream": 7}})
    np.testing.assert_array_equal(samples.time_s[:5], TIMES + 7)
