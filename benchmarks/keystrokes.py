"""Keystrokes of simulated pianists: contact, speed and fingering compared with the truth."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks import pianist
from benchmarks.benchmark_table import PrintedTable, Row, of_each_person, percent, run_study
from benchmarks.pianist import Struck
from shukotsu.hand.read_results import read
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.tables.poses import RecordingName

WRITTEN_TO = "benchmarks.md", "keystrokes"
PEOPLE = 6, 9900
TEMPI = {"slow": 0.5, "medium": 0.3, "fast": 0.18}
"""Seconds between keystrokes, by tempo."""

DURATION_S, CALIBRATION_S, ONSET_SD_S = 24.0, 25.0, 0.001
Strokes = Mapping[str, Sequence[Struck]]
"""Keystrokes by tempo."""


def run(n_hands: int, seed: int) -> Iterator[PrintedTable]:
    """Yield the table over n_hands people."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth = write_study(folder, n_hands, seed)
        run_study(folder, 2, "--until", "measure_movement")
        results = folder / "results" / "study"
        strokes = pd.concat([read(results / f"sub-{subject}" / "event_strokes.parquet") for subject in truth])
    yield PrintedTable(
        "keystrokes",
        (
            "tempo", "strokes:d", "used %:.1f", "digit %:.1f", "of used %:.1f", "contact ms:+.1f", "sd:.1f",
            "< 4 ms %:.1f", "held:.1f", "speed %:+.1f", "rms:.1f", "held:.1f",
        ),
        [_row(tempo, strokes[strokes["task"] == tempo], truth) for tempo in TEMPI],
        f"{n_hands} people, {DURATION_S:.0f} s at every tempo; no event names a digit. Digit: strokes with "
        "the right digit, of all and of those used. Contact: error of key_down_s, mean and standard "
        "deviation. Speed: error at contact, mean and rms. Held: % of errors within 1.96 stated sd.",
    )  # fmt: skip


def write_study(folder: Path, people: int, seed: int) -> dict[str, Strokes]:
    """Write recordings, sheets and study file; return the true keystrokes by subject."""
    subjects = [f"{number:02}" for number in range(people)]
    played = of_each_person(partial(_record_person, folder, seed), people, 0)
    truth = dict(zip(subjects, played, strict=True))
    sheet, events = ["subject\thand\ttask\trole\tfile"], ["subject\thand\ttask\tonset_s\tduration_s\tname"]
    for number, subject in enumerate(subjects):
        who = f"{subject}\t{_side(number)}"
        sheet += [
            f"{who}\t{task}\t{'evaluation' if task in TEMPI else 'calibration'}\t{subject}_{task}.parquet"
            for task in ("rom", *TEMPI)
        ]
        for task, strokes in truth[subject].items():
            rng = np.random.default_rng([seed, number, len(task)])
            for struck in strokes:
                onset_s = struck.contact_s + rng.normal(0, ONSET_SD_S)
                held_s = struck.up_s - struck.contact_s
                events.append(f"{who}\t{task}\t{onset_s:.4f}\t{held_s:.3f}\tnote {struck.pitch}")
    (folder / "recordings.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    (folder / "events.tsv").write_text("\n".join(events) + "\n", "utf-8")
    text = "study: study\nrecordings: recordings.tsv\nevents: events.tsv\nlayout: liberty16\n"
    (folder / "study.yaml").write_text(text + "models: [whole-hand]\n", "utf-8")
    return truth


def _side(number: int) -> str:
    return ("right", "left")[number % 2]


def _record_person(folder: Path, seed: int, number: int) -> Strokes:
    """Record one person's calibration and the three tempi; return the true keystrokes."""
    side, person = _side(number), seed + number
    calibration = simulate(RecordingName("01", side, "rom"), person, Realism(), round(240 * CALIBRATION_S))
    write_recording(folder / f"{number:02}_rom.parquet", calibration)
    strokes = {}
    for task, interval_s in TEMPI.items():
        played = pianist.play(person, side, interval_s, DURATION_S)
        write_recording(folder / f"{number:02}_{task}.parquet", played.poses)
        strokes[task] = played.strokes
    return strokes


def _row(tempo: str, strokes: pd.DataFrame, truth: Mapping[str, Strokes]) -> Row:
    """Compare all strokes of one tempo with the truth."""
    pairs: list[tuple[Any, Struck]] = []
    for subject, struck in truth.items():
        rows = strokes[strokes["subject"] == subject].sort_values("onset_s").itertuples()
        pairs += zip(rows, sorted(struck[tempo], key=lambda stroke: stroke.contact_s), strict=True)
    right = [(row, stroke) for row, stroke in pairs if row.used and row.digit == stroke.digit]
    used = sum(row.used for row, _ in pairs)
    lag = np.array([1e3 * (row.key_down_s - stroke.contact_s) for row, stroke in right])
    lag_sd, speed, speed_sd = np.array(
        [(row.key_down_sd_ms, row.contact_speed_mm_s, row.contact_speed_sd_mm_s) for row, _ in right]
    ).T
    true = np.array([stroke.speed_mm_s for _, stroke in right])
    off = 100 * (speed / true - 1)
    named = sum(row.digit == stroke.digit for row, stroke in pairs)
    shares = [100 * used / len(pairs), 100 * named / len(pairs), 100 * len(right) / max(1, used)]
    lag_held = percent(np.abs(lag) < 1.96 * lag_sd)
    speed_held = percent(np.abs(speed - true) < 1.96 * speed_sd)
    times = [float(lag.mean()), float(lag.std()), percent(np.abs(lag) < 4), lag_held]
    speeds = [float(off.mean()), float(np.sqrt(np.mean(off**2))), speed_held]
    return tempo, len(pairs), *shares, *times, *speeds
