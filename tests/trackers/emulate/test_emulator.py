"""The line behind the device: what it carries, what it loses and what it spoils, in made-up time."""

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.emulate.device import World
from shukotsu.trackers.emulate.emulator import FIFO_BYTES, SECOND_NS, Behaviour, Emulator
from shukotsu.trackers.emulate.faults import FAULTS, damaged, parse_fault, parse_time
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.liberty.emulated_device import EmulatedLiberty

VRPN_SETUP = b"O*,2,7,8,0\rF1\rC\r"


class Bench:
    """An emulator and what it has put out, for as long as one likes."""

    def __init__(self, stations: int, setup: bytes, **behaviour: object) -> None:
        device = EmulatedLiberty(World(built_in_motion(), frozenset(range(1, stations + 1))))
        self.out = bytearray()
        self.reads = True
        self.emulator = Emulator(device, Behaviour(**behaviour), self._write, 1)  # type: ignore[arg-type]
        self.emulator.receive(setup, 0)

    def _write(self, data: bytes) -> int:
        if self.reads:
            self.out += data
        return len(data) if self.reads else 0

    def until(self, seconds: float) -> None:
        """Let that much time pass since the start."""
        for millisecond in range(round(seconds * 1000) + 1):
            self.emulator.run(millisecond * SECOND_NS // 1000)


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


@pytest.mark.parametrize(
    ("fault", "text", "length"),
    [("drop-bytes", "3@7f", 97), ("duplicate-bytes", "3@7f", 103), ("garbage", "9@7f", 109)],
)
def test_a_fault_at_a_time_hits_that_cycle_alone(fault: str, text: str, length: int) -> None:
    """Bytes that are not hit stay as they are, and the same seed does the same."""
    faults = [parse_fault(fault, text)]
    data = bytes(range(100))
    spoilt = damaged(data, [0, 50], faults, 7, 240.0, 0)  # type: ignore[arg-type]
    assert len(spoilt) == length
    assert damaged(data, [0, 50], faults, 7, 240.0, 0) == spoilt  # type: ignore[arg-type]
    assert damaged(data, [0, 50], faults, 8, 240.0, 0) == data  # type: ignore[arg-type]
    rest = iter(spoilt if length > 100 else data)
    assert all(byte in rest for byte in (data if length > 100 else spoilt)), "in the same order"


def test_rates_are_kept_to_and_two_faults_do_not_hit_the_same_places() -> None:
    """Of a hundred thousand bytes a hundredth and another, drawn one by one though the faults are alike."""
    fault = parse_fault("flip-bytes", "0.01")
    zeros = bytes(100_000)
    once, twice = (damaged(zeros, [0], [fault] * n, 3, 240.0, 3) for n in (1, 2))  # type: ignore[list-item]
    hits = np.flatnonzero(np.frombuffer(once, np.uint8))
    assert len(hits) == pytest.approx(1000, abs=100)
    assert hits.mean() == pytest.approx(50_000, abs=4000)
    assert np.count_nonzero(np.frombuffer(twice, np.uint8)) > 1850


def test_a_device_that_vanishes_leaves_half_a_record() -> None:
    bench = Bench(2, b"F1\rO*,9\rC\r", gone_at=parse_time("gone-at", "0.1"))
    bench.until(1.0)
    assert bench.emulator.gone
    assert len(bench.out) == 24 * 24 + 6


@pytest.mark.parametrize("name", FAULTS)
def test_faults_that_cannot_be_read_are_refused(name: str) -> None:
    for text in ("", "x", "3@", "@2", "3@-1", "3@2-4", "-0.5", "1.5", "0@1"):
        with pytest.raises(InputError, match=f"--{name}: is .*expected"):
            parse_fault(name, text)
