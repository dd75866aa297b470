"""Keystrokes of simulated pianists of two drawings: contact, speed, angles, fingering, independence."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from benchmarks import other_hands, pianist
from benchmarks.benchmark_table import Cell, TextTable, workers
from benchmarks.faultless_hands import FACINGS
from benchmarks.measured_movement import all_true_angles_deg, other_bones
from benchmarks.other_hands.keyboard import press_keys
from benchmarks.pianist import Played, Struck
from benchmarks.processes import ROOT, run_python
from shukotsu.read_results import read
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.results import EVENT_TABLES
from shukotsu.skeleton.rotations import Array, conjugate, rotate
from shukotsu.stages.simulate.random_hand import DIGITS
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate
from shukotsu.statistics.permutation_test import group_test

WRITTEN_TO = "keystrokes.md", "tables"
FIRST_SEED = 9900
TEMPI = {"slow": 0.5, "medium": 0.3, "fast": 0.18}
"""Seconds from a keystroke to the next."""

SESSIONS = ("a", "b")
OWN, OTHER = "own", "other"
GOES_ALONG = (0.12, 0.30)
"""How far a neighbouring finger goes along, in the two groups that differ."""

DURATION_S, CALIBRATION_S, ONSET_SD_S = 24.0, 25.0, 0.001
Key = tuple[str, str, str]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    parser.add_argument("--people", type=int, default=6, help="of each drawing (6)")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help=f"of the first ({FIRST_SEED})")


def run(people: int = 6, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the tables over that many people of each drawing."""
    rows: list[tuple[Cell, ...]] = []
    independence = []
    for drawing in (OWN, OTHER):
        with tempfile.TemporaryDirectory() as name:
            truth = write_study(Path(name), drawing, people, seed)
            run_study(Path(name))
            found = read_events(Path(name) / "results" / "study", truth)
        rows += [_row(drawing, tempo, found, truth) for tempo in TEMPI]
        independence.append(_independence(found, people))
    yield _strokes_table(rows, people)
    yield _groups_table(np.array(independence))


def write_study(folder: Path, drawing: str, people: int, seed: int) -> dict[Key, Played]:
    """Write recordings, sheets and study file; give what is true, by subject, session and task."""
    jobs = [(f"{number:02}", session) for number in range(people) for session in SESSIONS]
    with workers() as pool:
        made = list(pool.map(partial(_recorded, folder, drawing, seed), jobs))
    truth = {key: played for own in made for key, played in own.items()}
    sheet, events = (
        ["subject\tsession\thand\ttask\trole\tfile"],
        ["subject\tsession\thand\ttask\tonset_s\tduration_s\tname"],
    )
    for number, session in jobs:
        side, who = ("right", "left")[int(number) % 2], f"{number}\t{session}"
        for task in ("calibration", *TEMPI):
            role = "calibration" if task == "calibration" else "evaluation"
            sheet.append(f"{who}\t{side}\t{task}\t{role}\t{number}_{session}_{task}.parquet")
        for task in TEMPI:
            rng = np.random.default_rng([seed, int(number), len(task)])
            for own in truth[number, session, task].strokes:
                onset_s = own.contact_s + rng.normal(0, ONSET_SD_S)
                held_s = own.up_s - own.contact_s
                events.append(f"{who}\t{side}\t{task}\t{onset_s:.4f}\t{held_s:.3f}\tnote {own.pitch}")
    (folder / "recordings.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    (folder / "events.tsv").write_text("\n".join(events) + "\n", "utf-8")
    text = "study: study\nrecordings: recordings.tsv\nevents: events.tsv\nlayout: liberty16\n"
    (folder / "study.yaml").write_text(text + "models: [whole-hand]\n", "utf-8")
    return truth


def _recorded(folder: Path, drawing: str, seed: int, who: tuple[str, str]) -> dict[Key, Played]:
    """Record one person in one session: the calibration, and the three tempi; give what is true of these."""
    number, session = who
    index = int(number)
    side, along = ("right", "left")[index % 2], GOES_ALONG[_group(index)]
    person = seed + index
    if drawing == OWN:
        frames = round(240 * CALIBRATION_S)
        made = simulate("01", side, "rom", person, Realism(), frames, session=session)
        calibration = made.poses()
    else:
        drawn = other_hands.draw_person(person, thumb_facing=FACINGS[person % len(FACINGS)])
        moves = 100 * person + SESSIONS.index(session)
        calibration = other_hands.record(
            drawn, side, "calibration", seed=moves, duration_s=CALIBRATION_S
        ).poses
    _write(folder / f"{number}_{session}_calibration.parquet", calibration)
    found = {}
    for task, interval_s in TEMPI.items():
        if drawing == OWN:
            played = pianist.play(person, side, interval_s, DURATION_S, along, session)
        else:
            played = _other_played(drawn, side, interval_s, along, [moves, round(1e3 * interval_s)])
        _write(folder / f"{number}_{session}_{task}.parquet", played.poses)
        found[number, session, task] = played
    return found


def _write(path: Path, poses: Poses) -> None:
    """Write poses as a tidy recording."""
    n_frames, n_segments = poses.valid.shape
    columns = {
        "frame": np.repeat(poses.frame, n_segments),
        "time_s": np.repeat(poses.time_s, n_segments),
        "segment": list(poses.segments) * n_frames,
        **{f"{axis}_mm": poses.position_mm[..., i].ravel() for i, axis in enumerate("xyz")},
        **{f"q{part}": poses.quaternion[..., i].ravel() for i, part in enumerate("wxyz")},
    }
    pq.write_table(pa.table(columns), path)


def run_study(folder: Path) -> None:
    """Run the workflow as far as the tables of strokes."""
    where = ["--directory", str(folder), "--configfile", str(folder / "study.yaml"), "--cores", "2"]
    command = ["-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), *where]
    run_python(*command, "--until", "measure_events", folder=folder)


def _other_played(
    person: other_hands.Person, side: str, interval_s: float, drags: float, seed: Sequence[int]
) -> Played:
    """Let a person of the other drawing play, finely in time, and record every fifth frame."""
    times, rate_hz = 5, 1200.0
    time_s = np.arange(round(DURATION_S * rate_hz)) / rate_hz
    angles_deg, presses = press_keys(person, np.random.default_rng(seed), time_s, interval_s, drags)
    made = other_hands.record(
        person,
        side,
        "keyboard",
        seed=sum(seed),
        duration_s=DURATION_S,
        rate_hz=rate_hz,
        angles_deg=angles_deg,
    )
    tips = np.stack([made.true_tip_mm[digit] for digit in DIGITS], 1)
    # from the index to the little finger, which a right hand has at the higher keys
    across = (tips[:, 4] - tips[:, 1]).mean(0) * np.array([1, 1, 0]) * (1 if side == "right" else -1)
    across /= np.linalg.norm(across)
    strokes = []
    for press in presses:
        frame = round(press.bottom_s * rate_hz)
        tip = tips[:, DIGITS.index(press.digit)]
        speed = float(np.linalg.norm(tip[frame - 1] - tip[frame - 3]) * rate_hz / 2)
        octave, step = divmod(int(np.floor(tip[frame] @ across / pianist.KEY_MM)), 7)
        pitch = 60 + 12 * octave + (0, 2, 4, 5, 7, 9, 11)[step]
        strokes.append(Struck(press.digit, press.from_s, press.bottom_s, press.leaves_s, pitch, speed))
    return Played(
        made.poses.take(np.arange(0, len(time_s), times)),
        strokes,
        tips[::times],
        made.true_pose.quaternion[::times, made.true_pose.segments.index("hand")],
        all_true_angles_deg(
            other_bones(person, {k: own[::times] for k, own in made.true_angles_deg.items()})
        ),
    )


def read_events(folder: Path, truth: Mapping[Key, Played]) -> dict[str, pd.DataFrame]:
    """Read the tables of strokes of all subjects."""
    who = dict.fromkeys(f"sub-{number}_ses-{session}" for number, session, _ in truth)
    return {name: pd.concat([read(folder / own / f"{name}.parquet") for own in who]) for name in EVENT_TABLES}


def _held(off: Array, sd: Array) -> float:
    return 100 * float(np.mean(np.abs(off) < 1.96 * sd))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _row(
    drawing: str, tempo: str, found: Mapping[str, pd.DataFrame], truth: Mapping[Key, Played]
) -> tuple[Cell, ...]:
    """Hold all strokes of one tempo against the truth."""
    pairs: list[tuple[Any, Struck]] = []
    at_contact, ranges, ratios = (list[tuple[float, float]]() for _ in range(3))
    for (number, session, task), played in truth.items():
        if task != tempo:
            continue
        strokes, angles, along = (
            own[(own["subject"] == number) & (own["session"] == session) & (own["task"] == task)]
            for own in (found["event_strokes"], found["event_angles"], found["event_independence"])
        )
        true = sorted(played.strokes, key=lambda own: own.contact_s)
        new = list(zip(strokes.sort_values("onset_s").itertuples(), true, strict=True))
        by_event = {row.event: own for row, own in new if row.used and row.digit == own.digit}
        known = angles["event"].isin(by_event) & angles["joint"].isin(played.angles_deg)
        for row in angles[known].itertuples():
            both = _angle_errors(row, by_event[row.event], played)
            at_contact += both[:1]
            ranges += both[1:]
        ratios += _ratios(along, played)
        pairs += new
    return drawing, tempo, *_stroke_numbers(pairs), *_angle_numbers(at_contact, ranges, ratios)


def _stroke_numbers(pairs: Sequence[tuple[Any, Struck]]) -> tuple[Cell, ...]:
    right = [own for own in pairs if own[0].used and own[0].digit == own[1].digit]
    used = sum(row.used for row, _ in pairs)
    lag = np.array([1e3 * (row.key_down_s - own.contact_s) for row, own in right])
    lag_sd, speed, speed_sd = np.array(
        [(row.key_down_sd_ms, row.contact_speed_mm_s, row.contact_speed_sd_mm_s) for row, _ in right]
    ).T
    true = np.array([own.speed_mm_s for _, own in right])
    off = 100 * (speed / true - 1)
    found = sum(row.digit == own.digit for row, own in pairs)
    shares = [100 * used / len(pairs), 100 * found / len(pairs), 100 * len(right) / max(1, used)]
    times = [float(lag.mean()), float(lag.std()), 100 * float(np.mean(np.abs(lag) < 4)), _held(lag, lag_sd)]
    return len(pairs), *shares, *times, float(off.mean()), _rms(off), _held(speed - true, speed_sd)


def _angle_numbers(*numbers: Sequence[tuple[float, float]]) -> tuple[Cell, ...]:
    angle, width, ratio = (np.array(own).reshape(-1, 2).T for own in numbers)
    going = _rms(ratio[0] - ratio[1]), float(np.corrcoef(ratio)[0, 1])
    return _rms(angle[0]), _held(*angle), _rms(width[0]), _held(*width), *going


def _angle_errors(row: Any, own: Struck, played: Played) -> list[tuple[float, float]]:
    """Error and stated sd of an angle at contact, and of its range on the way."""
    index, true = ("flexion", "abduction", "rotation").index(row.angle), played.angles_deg[row.joint]
    time_s = played.poses.time_s
    on_way = (time_s >= own.falls_s) & (time_s < own.contact_s)
    at = float(np.interp(own.contact_s, time_s, true[:, index]))
    width = float(np.ptp(np.append(true[on_way, index], at)))
    return [(row.at_contact_deg - at, row.at_contact_sd_deg), (row.range_deg - width, row.range_sd_deg)]


def _ratios(along: pd.DataFrame, played: Played) -> Iterator[tuple[float, float]]:
    """Entries of an independence matrix, found and true."""
    time_s, in_hand = played.poses.time_s, rotate(conjugate(played.turn)[:, None], played.tip_mm)
    busy = {d: [(s.falls_s - 0.1, s.up_s + 0.1) for s in played.strokes if s.digit == d] for d in DIGITS}
    true: dict[tuple[str, str], list[float]] = {}
    for own in played.strokes:
        way = (time_s >= own.falls_s) & (time_s <= own.contact_s)
        moved = in_hand[way] - in_hand[way][:1]
        end = moved[-1, DIGITS.index(own.digit)]
        shares = moved @ end / np.linalg.norm(end)
        striker = shares[:, DIGITS.index(own.digit)]
        ratio = shares.T @ striker / (striker @ striker)
        for index, other in enumerate(DIGITS):
            if other != own.digit and not any(a < own.contact_s and b > own.falls_s for a, b in busy[other]):
                true.setdefault((own.digit, other), []).append(float(ratio[index]))
    for row in along.itertuples():
        values = true.get((row.digit, row.other_digit), [])
        if min(row.n, len(values)) >= 3:
            yield row.mean_ratio, float(np.mean(values))


def _strokes_table(rows: Sequence[tuple[Cell, ...]], people: int) -> TextTable:
    columns = (
        "drawing", "tempo", "strokes:d", "used %:.1f", "digit %:.1f", "of used %:.1f", "contact ms:+.1f",
        "sd:.1f", "< 4 ms %:.1f", "held:.1f", "speed %:+.1f", "rms:.1f", "held:.1f", "angle deg:.1f",
        "held:.1f", "range deg:.1f", "held:.1f", "along:.3f", "r:.3f",
    )  # fmt: skip
    meaning = (
        f"{people} people of each drawing in two sessions, {DURATION_S:.0f} s at every tempo; no event names "
        "a digit. Digit: found, of all strokes, and of those used. Contact: error of key_down_s, mean and "
        "standard deviation. Speed: error at contact, mean and root mean square (rms). Held: % of errors "
        "within 1.96 of the stated sd. Angles of the striking finger at contact, and their range "
        "on the way down, rms error. Along: rms error of mean_ratio, and its "
        "correlation with the truth."
    )
    return TextTable("keystrokes", columns, rows, meaning)


def _independence(found: Mapping[str, pd.DataFrame], people: int) -> Array:
    """Mean independence of the four fingers over sessions and tempi, by person."""
    own = found["event_measures"]
    own = own[(own["measure"] == "independence") & (own["digit"] != "thumb")]
    mean = own.groupby("subject")["value"].mean()
    return np.array([mean[f"{number:02}"] for number in range(people)])


def _groups_table(values: Array) -> TextTable:
    """Compare groups that differ in independence, and right and left hands, which do not; values : (2, N)."""
    rows: list[tuple[Cell, ...]] = []
    number = np.arange(values.shape[1])
    for name, group in (("goes along more", _group(number)), ("right or left", number % 2)):
        first, second = values[:, group == 0].ravel(), values[:, group == 1].ravel()
        if len(first) and len(second):
            sizes = len(first), len(second), float(first.mean()), float(second.mean())
            rows.append((name, *sizes, group_test(first, second)[0]))
    meaning = (
        "Mean independence of the four fingers over sessions and tempi, people of both drawings; p "
        f"by permutation. In the second group a neighbour goes along by {GOES_ALONG[1]} in place of "
        f"{GOES_ALONG[0]}; right and left hands do not differ."
    )
    columns = ("groups", "n:d", "n:d", "independence:.3f", "of the others:.3f", "p:.4f")
    return TextTable("keystrokes: groups", columns, rows, meaning)


def _group(number: Any) -> Any:
    """Which of the two groups a person is of: right and left hands in both."""
    return number // 2 % 2
