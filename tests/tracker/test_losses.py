"""Recorder and decoder both count the true losses of random outages, in simulated time."""

import itertools
import random
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from tracker_streams import settings, viper_frame

from shukotsu.arrays import Bools, Integers
from shukotsu.tracker.archive import ArchiveWriter, open_archive
from shukotsu.tracker.display import Statistics
from shukotsu.tracker.emulated_device import EmulatedLiberty, built_in_motion
from shukotsu.tracker.liberty import record_type
from shukotsu.tracker.records import StreamSettings
from shukotsu.tracker.stream import ABSENT_S, STOP_FRAMES, ChunkDecoder
from shukotsu.tracker.survey import Survey, flagged_records, survey_archive

SECONDS, TICK_S, LOOK_S, WRAP = 8.0, 0.01, 0.2, 2**32

KINDS = {
    "liberty": ("liberty", (9, 2, 7), 3, 240),
    "liberty clock": ("liberty", (8, 2, 7), 2, 240),
    "patriot": ("patriot", (9, 2, 7), 2, 60),
    "viper": ("viper", (), 3, 120),
}


class Sent(NamedTuple):
    """A record (for a VIPER, a frame) that the tracker sent, and the part of it that arrives."""

    time_s: float
    frame: int
    stations: tuple[int, ...]
    data: bytes
    arriving: bytes


class Plugged(EmulatedLiberty):
    """A tracker with a receiver that is unplugged and plugged in again; out : station, from and until [s]."""

    out = (0, 0.0, 0.0)

    def present(self, cycles: Integers) -> Bools:
        """Return whether each station is plugged in, (T, S)."""
        present, since_s = super().present(cycles), (cycles - (WRAP - 300)) / float(self.rate)
        if self.out[0]:
            present[(since_s >= self.out[1]) & (since_s < self.out[2]), self.out[0] - 1] = False
        return present


def sent_by(kind: str, out: tuple[int, float, float]) -> list[Sent]:
    family, items, count, rate_hz = KINDS[kind]
    stations, sent = range(1, count + 1), []
    if family == "viper":
        for frame in range(round(SECONDS * rate_hz)):
            time_s = frame / rate_hz
            here = tuple(s for s in stations if s != out[0] or not out[1] <= time_s < out[2])
            data = viper_frame((WRAP - 300 + frame) % WRAP, here)
            sent.append(Sent(time_s, frame, here, data, data))
        return sent
    device = Plugged(built_in_motion(), frozenset(stations), family=family, ports=count, rate_hz=rate_hz)
    device.out, device.streaming = out, True
    device.receive(b"F1\rO*,%s\r" % ",".join(map(str, items)).encode())
    device.cycle = WRAP - 300
    device.counted_from = device.cycle if "clock" in kind else 0
    size = record_type(items).itemsize
    for nth in range(round(SECONDS * device.rate)):
        cycle = device.next_cycle()
        for first in range(0, len(cycle), size):
            data = cycle[first : first + size]
            sent.append(Sent(nth / float(device.rate), nth, (data[2],), data, data))
    return sent


def with_losses(sent: list[Sent], gaps: list[tuple[float, float, bool]]) -> list[Sent]:
    """Remove the data sent in gaps (from [s], to [s], whether bytes rather than whole records are lost)."""
    hit = [[cuts for a, b, cuts in gaps if a <= record.time_s < b] for record in sent]
    line = []
    for nth, record in enumerate(sent):
        third = len(record.data) // 3
        arriving = b"" if hit[nth] else record.data
        if any(hit[nth]) and nth and not hit[nth - 1]:
            arriving = record.data[: third - 1]
        elif any(hit[nth]) and nth + 1 < len(sent) and not hit[nth + 1]:
            arriving = record.data[2 * third + 1 :]
        line.append(record._replace(arriving=arriving))
    return line


def counts(came: dict[int, set[int]], rate_hz: float) -> tuple[int, int, int, dict[int, int]]:
    """Count lost frames, partial cycles, cycles and lost records as the guide defines; came : receivers by
    frame.
    """
    frames = sorted(came)
    before, last = frames[-2:]
    end = before + 1 if last - before - 1 <= STOP_FRAMES else last
    lost, partial = dict.fromkeys(sorted(set().union(*came.values())), 0), set()
    for station in lost:
        heard = [frames[0] - 1, *(f for f in frames[:-1] if station in came[f]), end]
        for a, b in itertools.pairwise(heard):
            others = [f for f in frames[:-1] if a < f < b]
            if len(others) < ABSENT_S * rate_hz:
                lost[station] += max(0, b - a - 1)
                partial |= set(others)
    return sum(f not in came for f in range(frames[0], end)), len(partial), len(frames), lost


def record_and_decode(
    path: Path, how: StreamSettings, line: list[Sent], draw: random.Random, stall: tuple[float, float]
) -> tuple[dict[str, Any], Survey]:
    """Return the recorder's totals and the decoder's survey; stall : the time in which the host reads
    nothing.
    """
    archive = ArchiveWriter(path, {}, lambda: 0)
    archive.settings(how.to_json(), 0)
    decoder, statistics = ChunkDecoder(how), Statistics(how, 0)
    ticks = [round(nth * TICK_S, 3) for nth in range(1, 860)]
    due = np.searchsorted([record.time_s for record in line], [0.0, *ticks])
    waiting = b""
    for now_s, first, last in zip(ticks, due[:-1], due[1:], strict=True):
        came = b"".join(record.arriving for record in line[first:last])
        waiting += came
        end = len(waiting) - (draw.randrange(60) if came and draw.random() < 0.3 else 0)
        if end > 0 and not stall[0] <= now_s < stall[1]:
            host_ns = round((now_s + draw.uniform(0, 0.003)) * 1e9)
            archive.received(waiting[:end], host_ns)
            decoder.add(waiting[:end], host_ns)
            waiting = waiting[end:]
        if now_s % LOOK_S < TICK_S:
            statistics.add(decoder.decode(final=False), 0, round(now_s * 1e9))
            archive.flush()
    archive.event("stopped", round(SECONDS * 1e9))
    archive.close({}, round(SECONDS * 1e9))
    statistics.add(decoder.decode(final=True), 0, 0)
    return statistics.totals(round(SECONDS * 1e9)), survey_archive(open_archive(path))


def check_session(path: Path, kind: str, seed: int) -> float:
    """Record and decode a tracker with outages; return the largest error of decoded times in s."""
    draw = random.Random(seed)
    family, items, count, rate_hz = KINDS[kind]
    gaps = []
    for _ in range(draw.randint(1, 3)):
        first = draw.choice([0.0, draw.uniform(0, SECONDS), draw.uniform(0, SECONDS)])
        length = draw.choice([draw.uniform(0.15, 0.6), draw.uniform(0.6, 3.0)])
        gaps.append((first, draw.choice([first + length, first + length, SECONDS]), draw.random() < 0.5))

    start, stall_s, late_s = draw.uniform(0.5, 4.5), draw.uniform(1, 5), draw.uniform(0.1, 0.7)
    out = (draw.randint(1, count), start, start + draw.uniform(2.0, 3.0))
    if count == 1 or draw.random() < 0.5:
        out = (0, 0.0, 0.0)
    stalls = all(b < stall_s - 1 or stall_s + 2.5 < a for a, b, _ in gaps)  # an outage would hide its losses
    line = with_losses(sent_by(kind, out), gaps)
    how = replace(settings(family, items, range(1, count + 1)), rate_hz=float(rate_hz))
    stall = (stall_s, stall_s + late_s * stalls)
    totals, survey = record_and_decode(path, how, line, draw, stall)
    lost = {int(s): heard["lost_frames"] for s, heard in totals["receivers"].items() if heard["records"]}
    recorded = (totals["lost_cycles"], totals["partial_cycles"], totals["cycles"], lost)
    losses = survey.losses
    lost = {station: heard.lost for station, heard in losses.stations.items()}
    assert recorded == (losses.all.lost, len(survey.partial_frames), losses.cycles, lost)
    whole = [(r, station) for r in line if r.arriving == r.data for station in r.stations]
    frames: dict[int, set[int]] = {}
    for record, station in whole:
        frames.setdefault(record.frame, set()).add(station)
    assert sum(heard.records for heard in losses.stations.values()) == len(whole)
    if len(frames) < 2:
        return 0.0
    assert recorded == counts(frames, rate_hz)
    sent_s = np.array([record.time_s for record, _ in whole])
    silent = [(a, b) for a, b in itertools.pairwise([0.0, *sent_s, SECONDS]) if b - a > 0.13]
    reported = [(a, SECONDS if b is None else b) for a, b in totals["silent_s"]]
    inner = [(a, b) for a, b in silent if (a > 0 and b < SECONDS) or b - a > 1.02]
    assert np.abs(np.array(reported).reshape(-1, 2) - np.array(inner).reshape(-1, 2)).max(initial=0) < 0.1
    parts = flagged_records(open_archive(path), survey)
    time_s = np.concatenate([part.time_s[~part.records.doubtful] for part in parts])
    return float(np.abs(time_s - (sent_s - sent_s[0])).max())


@pytest.mark.parametrize("kind", KINDS)
def test_recorder_and_decoder_count_the_true_losses(kind: str, tmp_path: Path) -> None:
    assert max(check_session(tmp_path / f"{seed}.arrows", kind, seed) for seed in range(3)) < 0.1
