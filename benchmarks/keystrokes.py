"""Keystrokes of simulated pianists: contact, speed and fingering compared with the truth."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.benchmark_table import PrintedTable, Row, of_each_person, percent, run_study
from shukotsu.hand.read_results import read
from shukotsu.hand.rotations import Array, from_matrix, rotate
from shukotsu.simulate.forward import bone_poses, coupled_angles
from shukotsu.simulate.random_hand import DIGITS, JOINTS, TIP_BONES, RandomHand, hand_of
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import distal_ends_mm, simulate
from shukotsu.simulate.task_motion import TaskMotion, posture, rest_posture
from shukotsu.tables.poses import Poses, RecordingName

WRITTEN_TO = "benchmarks.md", "keystrokes"
PEOPLE = 6, 9900
TEMPI = {"slow": 0.5, "medium": 0.3, "fast": 0.18}
"""Seconds between keystrokes, by tempo."""

DURATION_S, CALIBRATION_S, ONSET_SD_S = 24.0, 25.0, 0.001


@dataclass(frozen=True)
class Struck:
    """A keystroke: digit, times when it reached the key's bottom and left it, pitch, and contact speed."""

    digit: str
    contact_s: float
    up_s: float
    pitch: int
    speed_mm_s: float


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
        played = play(person, side, interval_s, DURATION_S)
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


# --- a person of the project's simulator who plays keys, with exactly known contact

KEY_MM, DIP_MM, RATE_HZ = 23.5, 14.0, 240.0
GOES_ALONG = 0.2
"""Share of a finger's movement that its neighbours follow."""
FIRST_PITCH, LIFTS_MM = 60, (4.0, 12.0)


@dataclass(frozen=True)
class Played:
    """A recording of playing, with the true keystrokes."""

    poses: Poses
    strokes: Sequence[Struck]


@dataclass(frozen=True)
class _Touch:
    digit: int
    contact_s: float
    held_s: float
    fall_s: float
    power: float
    lift_mm: float


def play(seed: int, side: str, interval_s: float, duration_s: float) -> Played:
    """Play one key after another."""
    rng = np.random.default_rng([seed, round(1e3 * interval_s)])
    piece = _Piece(hand_of("01", side, seed, Realism()), rng, interval_s, duration_s)
    n_frames = round(duration_s * RATE_HZ)
    motion = simulate(RecordingName("01", side, "opposition"), seed, Realism(), n_frames, change=piece.played)
    return Played(motion, piece.strokes(motion.time_s[0]))


class _Piece:
    """A piece of music: posture of the hand as a function of time."""

    def __init__(
        self, hand: RandomHand, rng: np.random.Generator, interval_s: float, duration_s: float
    ) -> None:
        self.hand, self.rng = hand, rng
        apart = np.abs(np.subtract.outer(np.arange(5), np.arange(5)))
        nearness = np.choose(np.minimum(apart, 3), [0, 1, 0.5, 0.25])
        share = GOES_ALONG * nearness * rng.uniform(0.7, 1.3, (5, 5))
        share[0], share[:, 0] = 0.3 * share[0], 0.3 * share[:, 0]  # the thumb is more independent
        self.share = share
        count = int((duration_s - 2.0) / interval_s)
        at_s = 1.2 + interval_s * (np.arange(count) + rng.normal(0, 0.04, count))
        digits = [int(rng.integers(5))]
        while len(digits) < count:
            digits.append(int(rng.choice([d for d in range(5) if d != digits[-1]])))
        held = np.minimum(0.25, 0.6 * interval_s)
        self.touches = [
            _Touch(d, float(t), float(held * rng.uniform(0.8, 1.2)),
                   float(min(0.11, 0.4 * interval_s) * rng.uniform(0.85, 1.15)),
                   float(rng.uniform(1.6, 2.3)), float(rng.uniform(*LIFTS_MM)))
            for d, t in zip(digits, at_s, strict=True)
        ]  # fmt: skip

    def played(self, motion: TaskMotion) -> TaskMotion:
        """Replace the motion of a task by playing that starts with the same pose of the arm."""
        time_s = np.arange(len(motion.wrist_mm)) / RATE_HZ
        shifts = np.cumsum(self.rng.choice([-1, 0, 1], 1 + int(time_s[-1] // 4)) * KEY_MM)
        distal = rotate(motion.forearm[0], np.array([1.0, 0.0, 0.0])) * np.array([1.0, 1.0, 0.0])
        distal = distal / np.linalg.norm(distal)
        self._wrist0, self._lateral = motion.wrist_mm[0], np.cross([0.0, 0.0, 1.0], distal)
        self._forearm = from_matrix(np.stack([distal, self._lateral, [0.0, 0.0, 1.0]], -1))
        self._shifts = np.clip(shifts, -2 * KEY_MM, 2 * KEY_MM)
        self._set_up()
        wrist = self._wrist(time_s)
        forearm = np.repeat(self._forearm[None], len(time_s), 0)
        return replace(motion, angles_rad=self._angles(self._bends(time_s)), wrist_mm=wrist, forearm=forearm)

    def _wrist(self, time_s: Array) -> Array:
        knots = np.arange(len(self._shifts)) * 4.0
        shift_mm = np.interp(time_s, np.sort(np.append(knots, knots + 3.4)), np.repeat(self._shifts, 2))
        slow = np.sin(2 * np.pi * 0.21 * time_s)
        return np.asarray(
            self._wrist0 + shift_mm[:, None] * self._lateral + slow[:, None] * np.array([2.0, 2.0, 1.0])
        )

    def _set_up(self) -> None:
        """Find the bend of each digit at rest above its key, and the joints by which it strikes."""
        home = rest_posture() + sum(
            posture(**{f"{d}_mcp": 12.0, f"{d}_pip": 18.0, f"{d}_dip": 6.0}) for d in DIGITS[1:]
        )
        self._home = home + posture(thumb_mcp=8.0, thumb_ip=8.0)
        self._stroke = np.zeros((10, len(JOINTS), 2))
        for i, d in enumerate(DIGITS[1:], 1):
            self._stroke[i] = posture(**{f"{d}_mcp": 1.0, f"{d}_pip": 0.1, f"{d}_dip": 0.05})
            self._stroke[5 + i] = posture(**{f"{d}_mcp": (0.0, 1.0)})
        cmc, mcp = JOINTS.index("thumb_cmc"), JOINTS.index("thumb_mcp")
        joints, angles = [cmc, cmc, mcp], [0, 1, 0]
        falls = []
        for joint, angle in zip(joints, angles, strict=True):
            self._stroke[0] = 0.0
            self._stroke[0, joint, angle] = 1.0
            rest, bent = self._heights(np.array([[0.0], [1.0]]) * np.eye(5)[0])[:, 0]
            falls.append(rest - bent)
        self._stroke[0, joints, angles] = np.array(falls) / np.linalg.norm(falls)
        self._bed = float(self._heights(np.zeros((1, 5)))[0].mean()) - 6.0
        self._rest = self._bends_at(self._bed + DIP_MM)
        self._bottom = self._bends_at(self._bed) - self._rest
        self._lifts = [self._bends_at(self._bed + DIP_MM + mm) - self._rest for mm in LIFTS_MM]
        self._deep = self._bottom[[touch.digit for touch in self.touches]]
        self._aim()

    def _aim(self) -> None:
        """Find the sideways angle at which each finger strikes near the middle of its key."""
        self._sways_deg = np.zeros(len(self.touches))
        at_s = np.array([touch.contact_s for touch in self.touches])
        bends = self._bends(at_s)
        lateral = self._lateral_mm(bends, at_s)
        for i, touch in enumerate(self.touches):
            if touch.digit:  # the thumb does not move sideways
                more = bends[i : i + 1] + np.eye(10)[5 + touch.digit]
                gain = self._lateral_mm(more, at_s[i : i + 1])[0, touch.digit] - lateral[i, touch.digit]
                off_mm = lateral[i, touch.digit] % KEY_MM - KEY_MM / 2 + self.rng.normal(0, 3.0)
                self._sways_deg[i] = np.clip(-off_mm / gain, -6.0, 6.0)
        touching = np.arange(len(self.touches)), [touch.digit for touch in self.touches]
        for _ in range(4):  # all digits must reach the same level, wherever the hand is
            bends = self._bends(at_s)
            low = self._tips(bends, at_s)[touching][:, 2]
            bends[touching] += 0.1
            slope = (self._tips(bends, at_s)[touching][:, 2] - low) / 0.1
            self._deep = self._deep + np.clip((self._bed - low) / slope, -4.0, 4.0)

    def _lateral_mm(self, bends: Array, time_s: Array) -> Array:
        return np.asarray((self._tips(bends, time_s) - self._wrist0) @ self._lateral)

    def _angles(self, bends: Array) -> Array:
        """Compute joint angles (T, J, 3) from the bends (T, 5), or bends and sideways angles (T, 10)."""
        postures = self._home + np.einsum("td,djk->tjk", bends, self._stroke[: bends.shape[1]])
        voluntary = np.concatenate([np.radians(postures), np.zeros((*postures.shape[:2], 1))], -1)
        return coupled_angles(voluntary, self.hand, Realism())

    def _tips(self, bends: Array, time_s: Array) -> Array:
        forearm = np.repeat(self._forearm[None], len(time_s), 0)
        bones = bone_poses(self.hand, self._angles(bends), self._wrist(time_s), forearm)
        return distal_ends_mm(self.hand.length_mm[TIP_BONES] + self.hand.soft_tip_mm, *bones)

    def _heights(self, bends: Array) -> Array:
        return self._tips(bends, np.zeros(len(bends)))[..., 2]

    def _bends_at(self, height_mm: float) -> Array:
        """Find the bend (5,) of each digit at which its tip has this height."""
        bends = np.zeros(5)
        for _ in range(12):
            low, high = self._heights(np.stack([bends, bends + 0.1]))
            bends = bends + np.clip((height_mm - low) / ((high - low) / 0.1), -6.0, 6.0)
        return bends

    def _bends(self, time_s: Array) -> Array:
        """Return bends and sideways angles (T, 10), by a digit's own strokes and those of its neighbours."""
        strokes_rad, sways_deg = np.zeros((len(time_s), 5)), np.zeros((len(time_s), 5))
        for touch, deep, sway_deg in zip(self.touches, self._deep, self._sways_deg, strict=True):
            d, t = touch.digit, time_s - touch.contact_s
            share = (touch.lift_mm - LIFTS_MM[0]) / (LIFTS_MM[1] - LIFTS_MM[0])
            top = (1 - share) * self._lifts[0][d] + share * self._lifts[1][d]
            fall = touch.fall_s
            ready = np.clip((t + 2 * fall) / fall, 0, 1)
            rise = np.clip((t - touch.held_s) / 0.07, 0, 1)
            down = np.clip((t + fall) / fall, 0, 1)
            bend = top * ready**2 * (3 - 2 * ready) + (deep - top) * down**touch.power
            gives = touch.power * (deep - top) / fall * 0.002
            bend += gives * np.where(t > 0, 1 - np.exp(-np.maximum(t, 0) / 0.002), 0)
            let_go = 1 - rise**3 * (10 - 15 * rise + 6 * rise**2)
            strokes_rad[:, d] += bend * let_go
            sways_deg[:, d] += sway_deg * ready**2 * (3 - 2 * ready) * let_go
        return np.concatenate([self._rest + strokes_rad + strokes_rad @ self.share.T, sways_deg], -1)

    def strokes(self, starts_s: float) -> list[Struck]:
        """Return the keystrokes in the recording's time, in which motion begins at `starts_s`."""
        struck = []
        for touch in self.touches:
            times = touch.contact_s + np.array([-1.1e-3, -1e-4])
            tips = self._tips(self._bends(times), times)[:, touch.digit]
            speed = float(np.linalg.norm(np.diff(tips, axis=0)) / 1e-3)
            white = int(np.floor((tips[1] - self._wrist0) @ self._lateral / KEY_MM))
            # the lateral axis points to the side of a right hand's thumb, where keys are lower
            white = -white if self.hand.side == "right" else white
            octave, step = divmod(white, 7)
            pitch = FIRST_PITCH + 12 * octave + (0, 2, 4, 5, 7, 9, 11)[step]
            at_s = starts_s + touch.contact_s
            struck.append(Struck(DIGITS[touch.digit], at_s, at_s + touch.held_s, pitch, speed))
        return struck
