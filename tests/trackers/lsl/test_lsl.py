"""LSL streams of a real outlet on this machine: recorded, decoded, sent on, and how they end."""

import re
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from fuzzing.sample_files import xdf_chunk
from lsl_here import LSL_HERE
from tracker_processes import PATIENCE_S, capture, started, until_lines

from shukotsu.errors import InputError
from shukotsu.files.xdf_streams import load_stream, read_streams
from shukotsu.trackers.lsl.port import pylsl, stream_lines

pytest.importorskip("pylsl")

SENDER = """
import sys, time, numpy as np, pylsl
name, rate_hz, unit = sys.argv[1], float(sys.argv[2]), sys.argv[3]
info = pylsl.StreamInfo(name, "MoCap", 112, rate_hz, "float32", name)
channels = info.desc().append_child("channels")
kinds = [f"Position{a}" for a in "XYZ"] + [f"Orientation{a}" for a in "ABCD"]
for at in range(112):
    owner = ("hand", "index_distal", *map(str, range(14)))[at // 7]
    channel = channels.append_child("channel")
    for told in ("object", owner), ("type", kinds[at % 7]), ("unit", unit * (at % 7 < 3)):
        channel.append_child_value(*told)
outlet, start, sent = pylsl.StreamOutlet(info), pylsl.local_clock(), 0
print(name, flush=True)
while True:
    time.sleep(0.003)
    new = np.arange(sent, int((pylsl.local_clock() - start) * 240))
    poses = np.zeros((len(new), 16, 7))
    poses[:, :, 0], poses[:, :, 3] = new[:, None] % 1000 / 1000, 1
    poses[new % 10 == 3, 1, 5] = np.nan
    outlet.push_chunk(poses.reshape(len(new), 112), (start + new / 240).tolist())
    sent += len(new)
"""


@pytest.fixture
def sender(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start a sender of 16 objects at 240 Hz for this machine; the second object lacks every tenth sample."""
    (tmp_path / "lsl.cfg").write_text(LSL_HERE)
    monkeypatch.setenv("LSLAPICFG", str(tmp_path / "lsl.cfg"))
    with ExitStack() as running:

        def start(rate_hz: float = 240, unit: str = "meters") -> subprocess.Popen[str]:
            command = [sys.executable, "-c", SENDER, tmp_path.name, str(rate_hz), unit]
            process = running.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
            running.callback(process.kill)
            assert process.stdout is not None
            assert process.stdout.readline().strip() == tmp_path.name
            return process

        yield start


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [240, 0])
def test_every_sample_is_kept_with_its_time(rate_hz: float, sender, tmp_path: Path) -> None:
    sender(rate_hz)
    out = tmp_path / "rom.arrows"
    done = capture("record", "--port", f"lsl:{tmp_path.name}", "--out", str(out), "--duration", "2")
    assert done.returncode == 0, done.stderr
    assert "; 0 frames lost" in done.stdout
    for name in ("a.parquet", "b.parquet"):
        assert capture("decode", "--in", str(out), "--out", str(tmp_path / name)).returncode == 0
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    records = pq.read_table(tmp_path / "a.parquet").to_pandas()
    first, second = (records[records.station == station] for station in (1, 2))
    number = np.rint(first.x_mm).astype(int)
    assert len(first) > 240
    np.testing.assert_array_equal(np.diff(number) % 1000, 1)
    np.testing.assert_allclose(first.time_s, (first.frame - first.frame.iloc[0]) / 240, atol=1e-4)
    assert set(first.frame[number % 10 == 3]) == set(first.frame) - set(second.frame)
    told = ["--layout", "liberty16", "--subject", "1", "--hand", "right", "--task", "rom"]
    imported = capture("import", "--in", str(out), "--out", str(tmp_path / "p.parquet"), *told)
    assert imported.returncode == 0, imported.stderr
    assert set(pq.read_table(tmp_path / "p.parquet")["segment"].to_pylist()) == {"hand", "index_distal"}


@pytest.mark.slow
@pytest.mark.parametrize("killed", ["recorder", "sender"])
def test_whoever_is_killed_what_came_is_kept(killed: str, sender, tmp_path: Path) -> None:
    source, out = sender(), tmp_path / "rom.arrows"
    with started("record", "--port", f"lsl:{tmp_path.name}", "--out", str(out)) as recorder:
        until_lines(recorder, 2)
        (recorder if killed == "recorder" else source).kill()
        _, told = recorder.communicate(timeout=PATIENCE_S)
    assert recorder.returncode == {"recorder": -signal.SIGKILL, "sender": 3}[killed]
    assert killed == "recorder" or "the port is gone (the stream has ended) after" in told
    inspected = capture("inspect", str(out)).stdout
    assert int(re.findall(r"1: (\d+),", inspected)[0]) > 200
    assert "skipped" not in inspected


@pytest.mark.slow
def test_a_unit_that_is_not_said_is_asked_for(sender, tmp_path: Path) -> None:
    sender(unit="")
    port = f"lsl:{tmp_path.name}"
    asked = capture("check", "--port", port)
    assert asked.returncode == 2
    assert "cm, mm or inch for all; where it says nothing give lsl:NAME?unit=mm" in asked.stderr
    told = capture("check", "--port", f"{port}?unit=m")
    assert told.returncode == 0, told.stderr
    assert "16 objects" in capture("devices").stdout


def test_without_the_package_nothing_else_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    assert stream_lines() == []
    with pytest.raises(InputError, match="pip install pylsl"):
        pylsl()


@pytest.mark.slow
@pytest.mark.usefixtures("sender")
def test_what_is_recorded_is_sent_for_others_too(emulated, tmp_path: Path) -> None:
    """An inlet of LSL's own, its samples in an XDF file: the archive's poses at the archive's times."""
    lsl = pylsl()
    out, name = tmp_path / "rom.arrows", f"sent {tmp_path.name}"
    how = ("--duration", "2", "--countdown", "4", "--note", "here", "--lsl-outlet", name)
    with started("record", "--port", emulated("--stations", "1-3"), "--out", str(out), *how) as recorder:
        poses, marks = (
            lsl.StreamInlet(lsl.resolve_byprop("name", own, timeout=PATIENCE_S)[0], recover=False)
            for own in (name, f"{name} markers")
        )
        head = poses.info(PATIENCE_S).as_xml().encode()
        marks.open_stream(PATIENCE_S)
        chunks = []
        with suppress(RuntimeError):  # the stream's end
            while True:
                chunks.append(poses.pull_chunk(PATIENCE_S, 1, as_numpy=True))
        assert [marks.pull_sample(PATIENCE_S)[0] for _ in range(3)] == [["start"], ["here"], ["stop"]]
        recorder.communicate(timeout=PATIENCE_S)
    number = struct.pack("<I", 1)
    data = b"XDF:" + xdf_chunk(1, b"<info/>") + xdf_chunk(2, number + head)
    for values, stamps in chunks:
        for row, stamp in zip(values, stamps, strict=True):
            data += xdf_chunk(3, number + struct.pack("<BBBd", 1, 1, 8, stamp) + row.astype("<f4").tobytes())
    (tmp_path / "a.xdf").write_bytes(data)
    (stream,) = read_streams(tmp_path / "a.xdf")
    assert [channel.owner for channel in stream.channels[::7]] == ["1", "2", "3"]
    time_s, sent, _ = load_stream(tmp_path / "a.xdf", stream)
    assert capture("decode", "--in", str(out), "--out", str(tmp_path / "a.parquet")).returncode == 0
    records = pq.read_table(tmp_path / "a.parquet").to_pandas()
    own = records[["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]].to_numpy().reshape(-1, 21)[: len(sent)]
    np.testing.assert_array_equal(np.array(sent, np.float32)[: len(own)], own)
    np.testing.assert_allclose(np.diff(time_s), 1 / 240, atol=5e-3)
