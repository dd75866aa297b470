"""What recorder and decoder count as lost is the same, and is what was lost: random outages in made-up time."""

import itertools
import random
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from fuzzing.tracker_streams import flock_record, viper_frame

from shukotsu.trackers.archive import ArchiveWriter, open_archive
from shukotsu.trackers.decode.losses import ABSENT_S, STOP_FRAMES
from shukotsu.trackers.decode.records_table import flagged_records
from shukotsu.trackers.decode.stream import ChunkDecoder
from shukotsu.trackers.decode.survey import survey_archive
from shukotsu.trackers.emulate.device import World, emulated_device
from shukotsu.trackers.emulate.faults import Plug, StreamTime
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.protocols.stream_settings import StreamSettings
from shukotsu.trackers.record.statistics import Statistics

SECONDS, TICK_S, LOOK_S, WRAP = 8.0, 0.01, 0.2, 2**32

KINDS = {
    "liberty": ("liberty", "binary", (9, 2, 7), 3, 240),
    "liberty ascii": ("liberty", "ascii", (9, 0, 2, 7, 1), 2, 120),
    "liberty clock": ("liberty", "binary", (8, 2, 7), 2, 240),
    "patriot": ("patriot", "binary", (9, 2, 7), 2, 60),
    "viper": ("viper", "binary", (), 3, 120),
    "fastrak": ("fastrak", "binary", (2, 11, 1), 3, 40),
    "fastrak alone": ("fastrak", "binary", (2, 4, 1), 1, 120),
    "fastrak ascii": ("fastrak", "ascii", (2, 4, 1), 2, 60),
    "trakstar": ("trakstar", "binary", (), 1, 100),
    "trakstar group": ("trakstar", "binary", (), 3, 100),
}


class Sent(NamedTuple):
    """A record as it left the tracker: VIPER's of a frame leave as one."""

    time_s: float
    frame: int
    stations: tuple[int, ...]
    data: bytes


def sent_by(kind: str, out: tuple[int, float, float] | None) -> list[Sent]:
    """What a tracker sends; `out`: a receiver, and when its plug is pulled and that it is back is known."""
    family, mode, items, count, rate_hz = KINDS[kind]
    stations = range(1, count + 1)
    if FAMILIES[family].emulated_device is None:
        sent = []
        for frame in range(round(SECONDS * rate_hz)):
            time_s = frame / rate_hz
            here = tuple(s for s in stations if out is None or s != out[0] or not out[1] <= time_s < out[2])
            if family == "viper":
                sent.append(Sent(time_s, frame, here, viper_frame((WRAP - 300 + frame) % WRAP, here)))
            else:
                sent += [Sent(time_s, frame, (s,), flock_record(frame, s, count > 1)) for s in here]
        return sent
    plugs = () if out is None else tuple(
        Plug(out[0], StreamTime(f"{at:f}"), back) for at, back in ((out[1], False), (out[2] - 1, True))
    )  # fmt: skip
    ports = FAMILIES[family].ports[-1]
    world = World(built_in_motion(), frozenset(stations), plugs)
    device = emulated_device(family, world, ports, FAMILIES[family].rates_hz[0])
    device.binary, device.unit = int(mode == "binary"), 1
    for station in device.stations.values():
        station.items = items
    if family == "liberty":
        device.receive(b"R3\r" if rate_hz == 120 else b"R4\r")
    device.cycle = 0 if "clock" in kind else WRAP - 300
    device.start_stream()
    sent, frame, before = [], -1, 99
    for nth in range(round(SECONDS * device.rate)):
        cycle = device.next_cycle()
        for first, last in itertools.pairwise([*cycle.starts, len(cycle.data)]):
            data = cycle.data[first:last]
            station = data[2] if family in ("liberty", "patriot") and mode == "binary" else int(data[:2])
            frame, before = frame + (station <= before), station
            number = frame if family == "fastrak" else nth
            sent.append(Sent(nth / float(device.rate), number, (station,), data))
    return sent


def outages(draw: random.Random) -> list[tuple[float, float, bool]]:
    """From when to when nothing passes, and whether records are cut by that; now and then both ends of it."""
    found = []
    for _ in range(draw.randint(1, 3)):
        start = draw.choice([0.0, draw.uniform(0, SECONDS), draw.uniform(0, SECONDS)])
        length = draw.choice([draw.uniform(0.15, 0.6), draw.uniform(0.6, 3.0)])
        found.append((start, draw.choice([start + length, start + length, SECONDS + 1]), draw.random() < 0.5))
    return found


def passed_through(sent: list[Sent], gaps: list[tuple[float, float, bool]]) -> list[tuple[Sent, bytes]]:
    """What of each record arrives."""

    def dead(record: Sent) -> bool:
        return any(start <= record.time_s < end for start, end, _ in gaps)

    cut = [any(cuts and start <= r.time_s < end for start, end, cuts in gaps) for r in sent]
    line = []
    for nth, record in enumerate(sent):
        third = len(record.data) // 3
        data = record.data
        if dead(record):
            data = b""
            if cut[nth] and nth and not dead(sent[nth - 1]):
                data = record.data[: third - 1]
            elif cut[nth] and nth + 1 < len(sent) and not dead(sent[nth + 1]):
                data = record.data[2 * third + 1 :]
        line.append((record, data))
    return line


def true_losses(line: list[tuple[Sent, bytes]], rate_hz: float) -> dict[str, object]:
    """Lost frames, partial ones and lost records by the words of the guide, a frame at a time."""
    came: dict[int, set[int]] = {}
    for record, data in line:
        if data == record.data:
            came.setdefault(record.frame, set()).update(record.stations)
    frames = sorted(came)
    first, last = frames[0], frames[-1]
    before = frames[-2] if len(frames) > 1 else last
    end = before + 1 if last - before - 1 <= STOP_FRAMES else last
    lost: dict[int, int] = {}
    partial: set[int] = set()
    for station in sorted(set().union(*came.values())):
        heard = [first - 1, *(f for f in frames if station in came[f] and f < last), end]
        lost[station] = 0
        for a, b in itertools.pairwise(heard):
            others = [f for f in frames if a < f < min(b, last)]
            if len(others) < ABSENT_S * rate_hz:
                lost[station] += max(0, b - a - 1)
                partial |= set(others)
    whole = sum(f not in came for f in range(first, end))
    return {"lost_cycles": whole, "partial_cycles": len(partial), "lost": lost, "cycles": len(frames)}


def session(path: Path, kind: str, seed: int):
    """Record and decode a tracker with outages; gives the line's truth, the recorder's totals, the survey."""
    draw = random.Random(seed)
    family, mode, items, count, rate_hz = KINDS[kind]
    gaps = outages(draw)

    def alone(at_s: float) -> bool:
        return all(end < at_s - 1 or at_s + 2.5 < start for start, end, _ in gaps)

    start, out = draw.uniform(0.5, SECONDS - 3.5), None
    if count > 1 and draw.random() < 0.5:
        out = (draw.randint(1, count), start, start + draw.uniform(2.0, 3.0))
        if family == "fastrak" and not (alone(out[1]) and alone(out[2])):
            out = None  # the others' rate changes, and in the midst of an outage nobody could tell when
    line = passed_through(sent_by(kind, out), gaps)
    stations = tuple(range(1, count + 1))
    options = {"group": True} if kind == "trakstar group" else {}
    lists = dict.fromkeys(stations, items) if items else {}
    settings = StreamSettings(family, mode, "cm", float(rate_hz), stations, lists, {}, options)
    stall_s = draw.uniform(1, SECONDS - 3)  # the host is late, which beside an outage nobody could tell apart
    late_s = draw.uniform(0.1, 0.7) if alone(stall_s) else 0.0
    archive = ArchiveWriter(path, {}, lambda: 0)
    archive.settings(settings.to_json(), 0)
    archive.event("started", 0)
    decoder, statistics = ChunkDecoder(settings), Statistics(settings, 0)
    at, waiting, arrived, looked = 0, b"", 0, 0.0
    for tick in range(1, round(SECONDS / TICK_S) + 60):
        now_s = tick * TICK_S
        came = b""
        while at < len(line) and line[at][0].time_s < now_s:
            came += line[at][1]
            at += 1
        waiting += came
        stalled = stall_s <= now_s < stall_s + late_s
        held = draw.randrange(60) if came and draw.random() < 0.3 else 0
        if not stalled and len(waiting) > held:
            host_ns = round((now_s + draw.uniform(0, 0.003)) * 1e9)
            piece, waiting = waiting[: len(waiting) - held], waiting[len(waiting) - held :]
            archive.received(piece, host_ns)
            decoder.add(piece, host_ns)
            arrived += len(piece)
        if now_s - looked > LOOK_S:
            looked = now_s
            statistics.add(decoder.decode(final=False), arrived, round(now_s * 1e9))
            archive.flush()
    end_ns = round(SECONDS * 1e9)
    archive.event("stopped", end_ns)
    archive.close({}, end_ns + 10**9)
    statistics.add(decoder.decode(final=True), 0, end_ns)
    return line, statistics.totals(end_ns), survey_archive(open_archive(path))


def errors(tmp_path: Path, kind: str, seed: int) -> dict[str, float]:
    """By how much recorder, decoder and truth differ; times in seconds."""
    path = tmp_path / f"{seed}.arrows"
    path.unlink(missing_ok=True)
    line, totals, survey = session(path, kind, seed)
    decoded = {
        "lost_cycles": survey.losses.all.lost,
        "partial_cycles": len(survey.partial_frames),
        "lost": {station: heard.lost for station, heard in survey.losses.stations.items()},
        "cycles": survey.losses.cycles,
    }
    recorded = {name: totals[name] for name in ("lost_cycles", "partial_cycles", "cycles")}
    recorded["lost"] = {
        int(s): own["lost_frames"] for s, own in totals["receivers"].items() if own["records"]
    }
    if not any(data == record.data for record, data in line):
        return {"unequal": recorded != decoded, "untrue": totals["records"] > 0, "time": 0.0}
    true = true_losses(line, KINDS[kind][4])
    whole = [(record, station) for record, data in line if data == record.data for station in record.stations]
    parts = list(flagged_records(open_archive(path), survey))
    time_s = np.concatenate([part.time_s[~part.records.doubtful] for part in parts])
    untrue = decoded != true or len(time_s) != len(whole)
    gone = np.array([record.time_s - whole[0][0].time_s for record, _ in whole])
    late = float(np.abs(time_s - gone).max()) if len(time_s) == len(whole) else np.inf
    return {
        "unequal": recorded != decoded,
        "untrue": untrue,
        "time": late,
        "true": true,
        "decoded": decoded,
        "recorded": recorded,
    }


@pytest.mark.parametrize("kind", KINDS)
def test_recorder_and_decoder_count_what_is_lost(kind: str, tmp_path: Path) -> None:
    for seed in range(6):
        found = errors(tmp_path, kind, seed)
        assert not found["unequal"], seed
        assert not found["untrue"], seed
        assert found["time"] < 0.1, seed
