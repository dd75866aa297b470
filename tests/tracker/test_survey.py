"""Decoding raw captures: counts and positions of losses, findings, import and clocks."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from captures import RATE_HZ, cycle, settings, write
from recording_files import WHO

from shukotsu.__main__ import main
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.typed_table import read_metadata, read_table
from shukotsu.tracker.archive import open_archive
from shukotsu.tracker.stream import Tally, blocks_of
from shukotsu.tracker.survey import FlaggedRecords, findings, fit_clock, flagged_records, survey_archive


def circling(frame: int, station: int) -> tuple[Sequence[float], Sequence[float]]:
    """Return the pose (cm, quaternion) of a receiver that circles the transmitter every 4 s."""
    angle = 2 * np.pi * frame / (4 * RATE_HZ)
    q = (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))
    return (30 * np.cos(angle), 30 * np.sin(angle), 2.125 + station), q


def survey_of(path: Path):
    return survey_archive(open_archive(path))


def decode(path: Path) -> FlaggedRecords:
    archive = open_archive(path)
    (part,) = flagged_records(archive, survey_archive(archive))
    return part


def test_a_faultless_capture_has_no_finding_and_every_record(tmp_path: Path) -> None:
    path = write(tmp_path / "a.arrows", [cycle(frame) for frame in range(100, 580)])
    survey = survey_of(path)
    assert findings(survey) == []
    assert survey.records == {1: 480, 2: 480, 3: 480}
    part = decode(path)
    assert part.records.frame[::3].tolist() == list(range(100, 580))
    assert part.time_s[::3] == pytest.approx(np.arange(480) / 240, abs=1e-12)
    assert part.records.station.tolist() == [1, 2, 3] * 480
    assert part.records.position_mm[:3, 0].tolist() == [210.0, 220.0, 230.0]
    assert survey.losses.all.host_ns == round(479e9 / 240)
    assert part.usable.all()
    assert not np.any([*part.flags.values()])


@pytest.mark.parametrize("size", [1, 1000, 50_000])
def test_decoding_does_not_depend_on_the_block_size(tmp_path: Path, size: int) -> None:
    cycles = [cycle(frame) for frame in range(300) if frame % 7]
    cycles[40] = cycles[40][:50] + cycles[40][51:]
    path = write(tmp_path / "a.arrows", cycles)
    whole = list(blocks_of(open_archive(path), Tally()))
    apart = list(blocks_of(open_archive(path), Tally(), size))
    for column in ("station", "frame", "offset", "doubtful"):
        joined = [np.concatenate([getattr(b.records, column) for b in part]) for part in (whole, apart)]
        np.testing.assert_array_equal(*joined)


def test_missing_frames_and_partial_cycles_are_located(tmp_path: Path) -> None:
    frames = [frame for frame in range(480) if frame not in (100, 101)]
    cycles = [cycle(frame, (1, 3) if frame in (200, 201, 202) else (1, 2, 3)) for frame in frames]
    path = write(tmp_path / "a.arrows", cycles)
    survey = survey_of(path)
    assert survey.losses.all.lost == 2
    assert survey.partial_frames.tolist() == [200, 201, 202]
    assert survey.gaps[:, :3].tolist() == [
        [0, 100, 101],
        [1, 100, 101],
        [2, 100, 101],
        [2, 200, 202],
        [3, 100, 101],
    ]
    assert findings(survey) == [
        "2 of 480 frames are missing for all receivers (at 0.42 s)",
        "3 of 480 frames lack a receiver (at 0.83 s, 0.84 s, 0.84 s)",
    ]


def test_silent_receivers_are_reported(tmp_path: Path) -> None:
    cycles = [cycle(f, (1, 3) if 300 <= f < 900 else (1, 2, 3)) for f in range(1200)]
    survey = survey_of(write(tmp_path / "a.arrows", cycles, settings((1, 2, 3, 7))))
    assert findings(survey) == [
        "receiver 7 was active and sent nothing",
        "receiver 2 sent nothing for 2.5 s, from 1.25 s on",
    ]


def crossing(frame: int, station: int):
    position, quaternion = circling(frame, station)
    mirrored = position[0] < 0 and station == 2
    return tuple(-p for p in position) if mirrored else position, quaternion


def test_mirrored_poses_are_flagged_or_repaired_on_import(tmp_path: Path) -> None:
    path = write(tmp_path / "a.arrows", [cycle(f, pose=crossing) for f in range(960)])
    tables = {}
    for name, more in (("kept", []), ("repaired", ["--repair-hemisphere"])):
        out = tmp_path / f"{name}.parquet"
        assert main(["import", f"--in={path}", *WHO, f"--out={out}", *more]) == 0
        tables[name] = read_table(out, POSES).to_pandas().query("segment == 'thumb_metacarpal'")
        assert read_metadata(out)["parameters"]["notes"] == []
    flipped = np.array([circling(f, 2)[0][0] < 0 for f in range(960)])
    assert (tables["kept"].valid == ~flipped).all()
    assert (tables["kept"]["flags"][flipped] == "hemisphere-flip").all()
    assert tables["repaired"].valid.all()
    assert (tables["repaired"]["flags"][flipped] == "hemisphere-repaired").all()
    true = np.array([circling(f, 2)[0] for f in range(960)], np.float32).astype(float) * 10
    assert np.array_equal(tables["repaired"][["x_mm", "y_mm", "z_mm"]].to_numpy(), true)


def test_a_capture_of_a_killed_recorder_is_reported_as_incomplete(tmp_path: Path) -> None:
    path = write(tmp_path / "a.arrows", [cycle(f) for f in range(200)], ended=False)
    path.write_bytes(path.read_bytes()[:-700])
    first, second = findings(survey_of(path))
    assert "are not complete entries" in first
    assert "was not closed by the recorder" in second
    assert survey_of(path).records[1] == 150


def arrivals(seconds: float, drift: float, rate_hz: float = 240.0):
    """Return frames and arrival times [ns] for a device clock off by `drift`, with delays of 1 ms and
    sometimes 200 ms.
    """
    random = np.random.default_rng(0)
    frame = np.arange(1000, 1000 + int(seconds * rate_hz), 2)
    sent_s = (frame - 1000) / rate_hz * (1 + drift)
    delay_s = 0.001 + random.exponential(0.003, len(frame))
    delay_s[random.random(len(frame)) < 0.01] += 0.2
    return frame, np.round((5.0 + np.maximum.accumulate(sent_s + delay_s)) * 1e9).astype(np.int64)


@pytest.mark.parametrize("drift", [-4e-4, 1e-4])
def test_a_drifting_device_clock_is_fitted(drift: float) -> None:
    frame, host_ns = arrivals(120.0, drift)
    clock = fit_clock(frame, host_ns, 240.0, 1000)
    assert clock.fitted
    assert clock.period_s * 240 == pytest.approx(1 + drift, abs=2e-5)
    other = fit_clock(*arrivals(60.0, 1.0), 240.0, 1000)  # another rate than the device's is not used
    assert (other.fitted, other.period_s) == (False, 1 / 240)
    assert other.measured_rate_hz == pytest.approx(120.0, rel=1e-4)
