"""The line behind the device: what it carries, what it loses and what it spoils, in made-up time."""

import struct
from pathlib import Path

import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.errors import InputError
from stages.capture.emulate.device import World
from stages.capture.emulate.emulator import SECOND_NS, Behaviour, Emulator
from stages.capture.emulate.faults import FAULTS, LineFault, damaged, parse_fault, parse_time
from stages.capture.emulate.liberty import Liberty
from stages.capture.emulate.line import FIFO_BYTES, Line
from stages.capture.emulate.poses_source import BuiltInMotion
from stages.capture.emulate.truth import Truth

VRPN_SETUP = b"O*,2,7,8,0\rF1\rC\r"
RS232_BYTES_PER_S = 11520.0


class Bench:
    """An emulator and what it has put out, for as long as one likes."""

    def __init__(
        self, stations: int, setup: bytes, *, rate: float | None = None, **behaviour: object
    ) -> None:
        device = Liberty(World(BuiltInMotion(), frozenset(range(1, stations + 1))))
        self.out = bytearray()
        self.reads = True
        self.truth = Truth()
        told = Behaviour(**behaviour)  # type: ignore[arg-type]
        self.emulator = Emulator(device, Line(rate), told, self.truth, self._write, 1)
        self.emulator.receive(setup, 0)

    def _write(self, data: bytes) -> int:
        if self.reads:
            self.out += data
        return len(data) if self.reads else 0

    def until(self, seconds: float) -> None:
        """Let that much time pass since the start."""
        for millisecond in range(round(seconds * 1000) + 1):
            self.emulator.run(millisecond * SECOND_NS // 1000)

    def kinds(self) -> list[str]:
        """Give what the log says, a word a row."""
        return list(self.truth.table()["kind"].to_pylist())


@pytest.mark.parametrize(("stations", "cycles_per_s", "lost"), [(1, 240, 0), (2, 145, 95), (8, 36, 204)])
def test_rs232_carries_so_many_cycles(stations: int, cycles_per_s: float, lost: float) -> None:
    """Records of 41 bytes at 115200 baud over 5 s: the line's 11520 bytes a second and one FIFO."""
    bench = Bench(stations, VRPN_SETUP, rate=RS232_BYTES_PER_S)
    bench.until(5.0)
    assert len(bench.out) % 41 <= 40
    assert len(bench.out) / (41 * stations) / 5 == pytest.approx(cycles_per_s, rel=0.04)
    assert bench.kinds().count("lost") / 5 == pytest.approx(lost, rel=0.02)
    assert len(bench.out) <= RS232_BYTES_PER_S * 5 + 1


def test_whole_cycles_are_lost_and_only_the_timestamp_tells() -> None:
    bench = Bench(3, VRPN_SETUP, rate=RS232_BYTES_PER_S)
    bench.until(2.0)
    whole = len(bench.out) // 123 * 123
    times = [struct.unpack_from("<I", bench.out, at + 36)[0] for at in range(0, whole, 41)]
    stations = [bench.out[at + 2] for at in range(0, whole, 41)]
    assert stations == [1, 2, 3] * (whole // 123)
    assert times[::3] == times[1::3] == times[2::3]
    assert times[:3] == [0, 0, 0]
    assert times[-1] > 1700
    assert max(b - a for a, b in zip(times[::3], times[3::3], strict=False)) >= 8


def test_a_reader_that_stops_costs_whole_cycles_beyond_the_fifo() -> None:
    bench = Bench(16, VRPN_SETUP)
    bench.until(1.0)
    before = len(bench.out)
    bench.reads = False
    bench.until(2.0)
    assert len(bench.out) == before
    bench.reads = True
    bench.until(2.1)
    late = len(bench.out) - before
    assert late == (FIFO_BYTES // (16 * 41) + 24) * 16 * 41
    assert bench.kinds().count("lost") == 240 - FIFO_BYTES // (16 * 41)


def test_without_buffering_only_the_newest_waits() -> None:
    bench = Bench(1, b"@B0\r" + VRPN_SETUP)
    bench.reads = False
    bench.until(1.0)
    assert bench.emulator.waiting == 41


@given(
    data=st.binary(min_size=50, max_size=400),
    since=st.integers(0, 10_000),
    seed=st.integers(0, 1000),
    texts=st.lists(
        st.tuples(
            st.sampled_from(["drop-bytes", "flip-bytes", "duplicate-bytes", "garbage"]), st.floats(0.001, 0.5)
        ),
        max_size=4,
    ),
)
def test_the_log_undoes_the_damage(
    data: bytes, since: int, seed: int, texts: list[tuple[str, float]]
) -> None:
    """From what came out and the log, the bytes that went in can be had again; and it is repeatable."""
    faults = [parse_fault(name, repr(rate)) for name, rate in texts]
    assert all(isinstance(fault, LineFault) for fault in faults)
    out, edits = damaged(data, [0, 20, 40], faults, since, 240.0, seed)  # type: ignore[arg-type]
    assert (out, edits) == damaged(data, [0, 20, 40], faults, since, 240.0, seed)  # type: ignore[arg-type]
    restored, done = b"", 0
    for place, edit in edits:
        restored += out[done:place] + data[edit.position : edit.position + edit.removed]
        assert out[place : place + len(edit.inserted)] == edit.inserted
        done = place + len(edit.inserted)
    assert restored + out[done:] == data


def test_an_idle_line_saves_nothing_up() -> None:
    out = bytearray()

    def write(data: bytes) -> int:
        out.extend(data)
        return len(data)

    line = Line(64.0)
    line.run(10.0, write)
    line.put(bytes(50))
    for now_s, carried in ((10.0, 0), (10.125, 8), (10.25, 16), (20.0, 50)):
        line.run(now_s, write)
        assert len(out) == carried


def test_two_faults_do_not_hit_the_same_places() -> None:
    """They are drawn one by one, even where they are alike."""
    fault = parse_fault("flip-bytes", "0.02")
    _, edits = damaged(bytes(5000), [0], [fault, fault], 7, 240.0, 0)  # type: ignore[list-item]
    assert len({edit.position for _, edit in edits}) > 150


def test_rates_are_kept_to() -> None:
    """A hundredth of a hundred thousand bytes, and the places are spread over all cycles."""
    fault = parse_fault("flip-bytes", "0.01")
    hits = [
        edit.position
        for since in range(1000)
        for _, edit in damaged(bytes(100), [0], [fault], since, 240.0, 3)[1]  # type: ignore[list-item]
    ]
    assert len(hits) == pytest.approx(1000, abs=100)
    assert sum(hits) / len(hits) == pytest.approx(50, abs=4)


@pytest.mark.parametrize("ending", [".parquet", ".csv"])
def test_the_log_says_where_in_the_stream(ending: str, tmp_path: Path) -> None:
    faults = tuple(
        parse_fault(name, text)
        for name, text in (("garbage", "7@10f"), ("flip-bytes", "2@12f"), ("drop-bytes", "1@23f"))
    )
    bench = Bench(2, b"F1\rO*,9\rC\r", faults=faults)
    bench.until(0.1)
    path = tmp_path / f"truth{ending}"
    bench.truth.write(path)
    read = pyarrow.csv.read_csv(path) if ending == ".csv" else pq.read_table(path)
    rows = read.to_pylist()
    sent = {row["frame"]: row for row in rows if row["kind"] == "sent"}
    assert sorted(sent) == list(range(24))
    assert [row["offset"] for row in sent.values()] == [24 * f + (7 if f > 10 else 0) for f in range(24)]
    assert sent[10]["size"] == 31
    assert sent[3]["stations"] == 3
    assert sent[23]["size"] == 23
    assert [(row["frame"], row["size"]) for row in rows if row["kind"] == "drop"] == [(23, 1)]
    (garbage,) = (row for row in rows if row["kind"] == "garbage")
    assert (garbage["offset"], garbage["size"], garbage["frame"]) == (240, 7, 10)
    assert bench.out[247:249] == b"LY"
    flips = [row for row in rows if row["kind"] == "flip"]
    clean = Bench(2, b"F1\rO*,9\rC\r")
    clean.until(0.1)
    assert len(flips) == 2
    for row in flips:
        assert bench.out[row["offset"]] != clean.out[row["offset"] - 7] == row["value"]


def test_a_device_that_vanishes_leaves_half_a_record() -> None:
    bench = Bench(2, b"F1\rO*,9\rC\r", gone_at=parse_time("gone-at", "0.1"))
    bench.until(1.0)
    assert bench.emulator.gone
    assert len(bench.out) == 24 * 24 + 6


def test_a_silent_device_sends_nothing() -> None:
    bench = Bench(2, b"F1\rC\r", silent=True)
    bench.until(0.5)
    bench.emulator.receive(b"P\r", SECOND_NS)
    assert bench.out == b""


def test_the_pace_follows_the_rate_that_is_set() -> None:
    """Half a second at 240 Hz and half at 120 Hz, with no cycle twice or left out."""
    bench = Bench(1, b"F1\rO1,9\rC\r")
    bench.until(0.5)
    bench.emulator.receive(b"R3\r", SECOND_NS // 2)
    for tenth in range(6, 11):
        bench.emulator.run(tenth * SECOND_NS // 10)
    frames = [struct.unpack_from("<I", bench.out, at + 8)[0] for at in range(0, len(bench.out), 12)]
    assert frames == list(range(len(frames)))
    assert len(frames) == pytest.approx(180, abs=2)


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("text", ["", "x", "3@", "@2", "3@-1", "3@2-x", "-0.5", "1.5-x", "3=9@1-2", "0@1"])
def test_faults_that_cannot_be_read_are_refused(name: str, text: str) -> None:
    with pytest.raises(InputError, match=f"--{name}: is .*expected"):
        parse_fault(name, text)


def test_times_are_seconds_or_cycles() -> None:
    when = parse_time("gone-at", "2.5")
    assert (when.begins(240), when.begins(120)) == (600, 300)
    assert parse_time("gone-at", "77f").begins(240) == 77
    with pytest.raises(InputError, match="--gone-at"):
        parse_time("gone-at", "1-2")
