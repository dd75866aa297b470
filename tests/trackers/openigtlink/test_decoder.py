"""OpenIGTLink: every kind of message and what stands beside them; frames and times by stamps, or by names."""

import struct
from pathlib import Path

import numpy as np
import pytest
from captures import write
from fuzzing.decoding import check_tiles, decode
from fuzzing.tracker_streams import igtl_frame, igtl_message, igtl_numbers, pose, settings

from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.findings import findings
from shukotsu.trackers.decode.records_table import flagged_records
from shukotsu.trackers.decode.survey import survey_archive
from shukotsu.trackers.families import decoder_of

TRANSFORM = igtl_numbers(b"TRANSFORM", 1, 1)
NAMES = {"1": "Tool 1", "2": "Tool 2", "3": "Tool 3"}


def of_tools(**options: object):
    return settings("openigtlink", stations=(1, 2, 3), unit="mm", names=NAMES, **options)


def tools_of(*names: bytes, told: dict[str, str] | None = None) -> bytes:
    parts = (struct.pack("20sBB", name, 1, 0) + TRANSFORM for name in names)
    return igtl_message(b"TDATA", b"Tracker", b"".join(parts), told=told)


@pytest.mark.parametrize(
    ("data", "stations", "names"),
    [
        (igtl_message(b"TRANSFORM", b"Tool 2", TRANSFORM), [2], []),
        (igtl_message(b"TRANSFORM", b"\x1b[Late", TRANSFORM), [4], ["?[Late"]),
        (igtl_message(b"TRANSFORM", b"A", TRANSFORM, told={"IGTL_DEVICE_NAME": "Tool 3"}), [3], []),
        (igtl_message(b"TRANSFORM", b"Tool 1", TRANSFORM, told={"TransformStatus": "MISSING"}), [], []),
        (igtl_message(b"TRANSFORM", b"Tool 1", TRANSFORM, told={"TransformValid": "FALSE"}), [], []),
        (tools_of(b"Tool 1", b"Tool 3", told={"Tool 1Status": "INVALID"}), [3], []),
        (tools_of(b"A" * 20, told={"A" * 20 + "tToTrackerStatus": "OK"}), [4], ["A" * 20 + "tToTracker"]),
        (igtl_message(b"STATUS", b"x", b"TRANSFORM" * 10) + tools_of(b"Tool 1"), [1], []),
        (igtl_message(b"TDATA", b"x", b""), [], []),
    ],
)
def test_what_messages_say_beside_poses(data: bytes, stations: list[int], names: list[str]) -> None:
    """Nothing of these is skipped: a tool that was not seen, or another message, is no damage."""
    decoder = decoder_of(of_tools())
    decoded = decode(decoder, data)
    assert decoded.records.station.tolist() == stations
    assert [*decoder.names.values()][3:] == names
    assert not decoded.skipped
    check_tiles(decoded, len(data))


@pytest.mark.parametrize("length", [28, 24, 12])
def test_positions_come_with_all_some_or_no_numbers_of_a_quaternion(length: int) -> None:
    numbers = igtl_numbers(b"POSITION", 3, 1)[:length]
    records = decode(decoder_of(of_tools()), igtl_message(b"POSITION", b"Tool 1", numbers)).records
    position, quaternion = pose(3, 1)
    assert records.position_mm[0] == pytest.approx(position, rel=1e-6)
    assert np.isfinite(records.quaternion).all() == (length > 12)
    assert length == 12 or abs(records.quaternion[0] @ quaternion) == pytest.approx(1) or quaternion[0] < 0
    assert not records.doubtful.any()


@pytest.mark.parametrize(
    "hostile",
    [
        igtl_message(b"IMAGE", b"x", b"")[:42] + struct.pack(">QQ", 2**63, 0),
        igtl_message(b"TDATA", b"x", b"")[:42] + struct.pack(">QQ", 70 * 250, 0),
        igtl_message(b"TRANSFORM", b"Tool 1", TRANSFORM)[:-1] + b"x",
        igtl_message(b"TDATA", b"x", b"1" * 70, told={"a": "b"}).replace(b"\0\x0c\0", b"\xff\xff\0"),
        bytes(3000) + igtl_message(b"TDATA", b"x", b"", 1 + 2**-32)[:42] + struct.pack(">QQ", 70, 1) * 9,
    ],
)
def test_no_length_and_no_wrong_sum_costs_what_follows(hostile: bytes) -> None:
    """It is skipped, counted, and neither waited for nor held."""
    frames = [b"".join(igtl_frame(b"TRANSFORM", frame, (1, 2, 3))) for frame in range(100)]
    decoder = decoder_of(of_tools())
    decoded = decode(decoder, hostile + b"".join(frames))
    assert len(decoded.records) == 300
    assert sum(skip.size for skip in decoded.skipped) == len(hostile)


FRAMES = [frame for frame in range(1200) if frame not in (100, 600, 601)]


@pytest.mark.parametrize("kind", [b"TRANSFORM", b"QTDATA"])
@pytest.mark.parametrize("steady", [True, False])
def test_stamps_tell_frames_times_and_what_is_lost(kind: bytes, steady: bool, tmp_path: Path) -> None:
    """They come in bursts and tools in any order; a clock that is set back costs nothing."""
    frames = [b"".join(igtl_frame(kind, frame, (3, 1, 2))) for frame in FRAMES]
    frames += [b"".join(igtl_frame(kind, frame, (3, 1, 2))) for frame in range(500, 510)]
    bursts = [b"".join(frames[first : first + 7]) for first in range(0, len(frames), 7)]
    given = of_tools(stamps=True, steady=steady, joined=True)
    archive = open_archive(write(tmp_path / "a.arrows", bursts, given, period_ns=7e9 / 240))
    survey = survey_archive(archive)
    assert [*survey.records.values()] == [len(frames) - 1] * 3  # the first may have been joined in its midst
    assert survey.losses.all.lost == (3 if steady else 0)
    assert any("cannot be counted" in told for told in findings(survey)) != steady
    time_s = np.concatenate([part.time_s for part in flagged_records(archive, survey)])[::3]
    expected = list(FRAMES[1:]) + list(range(1200, 1210))
    assert time_s == pytest.approx((np.array(expected) - 1) / 240, abs=1e-6)


def test_without_stamps_names_tell_frames_and_arrivals_times(tmp_path: Path) -> None:
    frames = [b"".join(igtl_frame(b"TRANSFORM", frame, (3, 1, 2), stamped=False)) for frame in range(600)]
    frames[300:400] = [b""] * 100
    survey = survey_archive(open_archive(write(tmp_path / "a.arrows", frames, of_tools(stamps=False))))
    assert survey.losses.all.lost == 100
    assert [*survey.records.values()] == [500] * 3
    assert survey.clock is not None
    assert survey.clock.time_s(np.array([599])) == pytest.approx(599 / 240, abs=1e-3)
    assert "the source does not tell the times of its frames" in " ".join(findings(survey))


def test_a_tool_in_two_kinds_of_messages_of_one_stamp_is_one_pose() -> None:
    data = b"".join(
        message
        for frame in range(20)
        for kind in (b"TRANSFORM", b"TDATA")
        for message in igtl_frame(kind, frame, (1, 2))
    )
    records = decode(decoder_of(of_tools(stamps=True)), data).records
    assert records.cycle.tolist() == np.repeat(np.arange(20), 2).tolist()
