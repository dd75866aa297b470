"""Exchanges that known drivers have with a real device, byte for byte, on a pseudo-terminal in real time."""

import struct
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from stages.capture.emulate.poses_source import BuiltInMotion

MM_PER_CM, MM_PER_INCH = 10.0, 25.4
VRPN_RECORD = 41
TUM_RECORD = 48


def vrpn_reset(client: Any, stations: int) -> None:
    """Bring a LIBERTY to streaming as VRPN's driver does (its waits of seconds shortened)."""
    for byte in (b"\r", b"F", b"0", b"\r", b"P"):
        client.send(byte)
        time.sleep(0.02)
    client.until_silent(0.1)
    assert client.reply(b"\x16\r").startswith(b"0")
    for station in range(1, stations + 1):
        assert client.reply(b"O%d,2,7,8,0\r" % station, 0.01) == b""
    for command in (b"X0,1,0,0\r", b"Y0,1,0,0\r", b"F1\r", b"C\r", b"Q0\r"):
        client.send(command)


def vrpn_records(stream: bytes) -> tuple[list[tuple[int, int, tuple[float, ...]]], int]:
    """Read records as VRPN does: station, timestamp, numbers; gives also how many bytes were skipped."""
    records, skipped, at = [], 0, 0
    while at + VRPN_RECORD <= len(stream):
        record = stream[at : at + VRPN_RECORD]
        whole = record[:2] == b"LY" and record[3:8] == b"C\x00\x00\x21\x00" and record[-1:] == b" "
        if whole and 1 <= record[2] <= 8:
            *numbers, device_ms = struct.unpack_from("<7fI", record, 8)
            records.append((record[2], device_ms, tuple(numbers)))
            at += VRPN_RECORD
        else:
            skipped, at = skipped + 1, at + 1
    return records, skipped


@pytest.mark.slow
@pytest.mark.parametrize("stations", [8, 5])
def test_vrpn_exchange_at_full_rate(emulated: Callable[..., Any], stations: int) -> None:
    """Nothing is lost in three seconds, and the numbers are those of the motion."""
    with emulated("--stations", f"1-{stations}", "--ports", "8") as running, running.open() as client:
        vrpn_reset(client, 8)
        begun = time.monotonic()
        stream = client.during(3.0)
        elapsed_s = time.monotonic() - begun
    records, skipped = vrpn_records(stream)
    assert skipped == 0
    per_station = {s: [r for r in records if r[0] == s] for s in range(1, 9)}
    assert [s for s, mine in per_station.items() if mine] == list(range(1, stations + 1))
    for station in range(1, stations + 1):
        mine = per_station[station]
        assert len(mine) / elapsed_s == pytest.approx(240, rel=0.1)
        after_reset = next(i for i in range(len(mine)) if mine[i][1] == 0)
        times = [device_ms for _, device_ms, _ in mine[after_reset:]]
        assert times == [count * 1000 // 240 for count in range(len(times))]
        position, quaternion = BuiltInMotion().poses(np.arange(len(times)), [station])
        sent = np.array([numbers for _, _, numbers in mine[after_reset:]])
        assert np.abs(sent[:, :3] * MM_PER_INCH - position[:, 0]).max() < 1e-4
        assert np.abs(sent[:, 3:] - quaternion[:, 0]).max() < 1e-7


@pytest.mark.slow
def test_tum_exchange_with_eight_stations(emulated: Callable[..., Any]) -> None:
    """Frame counts run without a gap, and all stations are in each cycle."""
    with emulated("--stations", "1-8") as running, running.open() as client:
        client.send(b"\r")
        client.send(b"p")
        client.send(b"\r")
        client.until_silent(0.2)
        client.send(b"f1\r")
        reply = client.reply(b"\x150\r")
        assert len(reply) == 12
        assert struct.unpack("<2sBBBBhHH", reply) == (b"LY", 0, 0x15, 0, 0, 4, 0xFF, 0xFF)
        client.send(b"O*,8,9,11,3,7\rh*,1,0,0\r")
        assert client.until_silent(0.2) == b""
        client.send(b"c\r")
        stream = client.during(3.0)
        client.send(b"p")
    cycles = len(stream) // (8 * TUM_RECORD)
    assert cycles == pytest.approx(720, rel=0.1)
    kind = np.dtype(
        {
            "names": ["tag", "station", "command", "error_size", "ms", "frame", "distortion", "pose"],
            "formats": ["S2", "u1", "u1", "<u4", "<u4", "<u4", "<i4", "7<f4"],
        }
    )
    grid = np.frombuffer(stream, kind, cycles * 8).reshape(cycles, 8)
    assert (grid["tag"] == b"LY").all()
    assert (grid["command"] == 67).all()
    assert (grid["error_size"] == 40 << 16).all()
    assert (grid["station"] == np.arange(1, 9)).all()
    assert (grid["frame"] == grid["frame"][:, :1]).all()
    assert (np.diff(grid["frame"][:, 0].astype(int)) == 1).all()
    assert (grid["ms"] == grid["frame"].astype(int) * 1000 // 240).all()


@pytest.mark.slow
def test_vrpn_fastrak_exchange(emulated: Callable[..., Any]) -> None:
    """Four receivers share 120 Hz; records have 32 bytes, the last of which is the guard."""
    with emulated("--device", "fastrak") as running, running.open() as client:
        client.send(b"cF")
        client.until_silent(0.1)
        status = client.reply(b"S")
        assert len(status) == 55
        assert status.startswith(b"21S000000 F3F  ")
        for station in range(1, 5):
            assert client.reply(b"O%d,2,11,0\r" % station, 0.01) == b""
            assert client.reply(b"e%d,0\r" % station, 0.01) == b""
        client.send(b"fC")
        stream = client.during(2.0)
    records = [stream[at : at + 32] for at in range(0, len(stream) - 31, 32)]
    assert len(records) == pytest.approx(240, rel=0.1)
    assert all(record[:1] == b"0" and record[2:3] == b" " and record[-1:] == b" " for record in records)
    stations = [record[1] - ord("0") for record in records]
    assert [1 + (stations[0] - 1 + i) % 4 for i in range(len(stations))] == stations
    numbers = np.array([struct.unpack_from("<7f", record, 3) for record in records])
    assert np.abs(np.linalg.norm(numbers[:, 3:], axis=1) - 1).max() < 1e-6


def test_invesalius_exchange_in_ascii(emulated: Callable[..., Any]) -> None:
    """P polls one line a receiver; numbers stand 9 characters apart."""
    with emulated("--stations", "1-3") as running, running.open() as client:
        client.reply(b"P")
        polled = client.reply(b"P")
    lines = polled.split(b"\r\n")
    assert lines.pop() == b""
    assert [len(line) for line in lines] == [58] * 3
    for station, line in enumerate(lines, 1):
        words = line.replace(b"-", b" -").split()
        assert int(words[0]) == station
        assert len([float(word) for word in words[1:]]) == 6


def test_stream_goes_on_when_a_client_leaves_and_nobody_reads(emulated: Callable[..., Any]) -> None:
    """The next client finds the device as it was left, and later frames."""
    with emulated("--stations", "1", "--start-frame", str(2**32 - 40)) as running:
        with running.open() as client:
            client.send(b"F1\rO*,9\rC\r")
            first = client.exactly(12)
        time.sleep(0.5)
        with running.open() as client:
            client.during(0.1)
            later = client.during(0.1)
    frames = [struct.unpack_from("<I", part, 8)[0] for part in (first, later[later.index(b"LY\x01C") :])]
    assert frames[0] >= 2**32 - 40
    assert frames[1] < 1000, "the frame count wraps"
