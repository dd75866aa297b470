"""Movement of simulated hands against its truth: ranges, ways and distances of tips, and their stated sd."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.accuracy import add_people
from benchmarks.benchmark_table import Cell, TextTable
from schemas.layout import read_layout
from schemas.parts import numbers_by_name
from schemas.poses import Poses, read_poses
from skeleton.angle_range import HIGH_PERCENT, LOW_PERCENT
from skeleton.joint_angles import angles_of_hand
from skeleton.rotations import Array, conjugate, rotate
from stages.capture import import_recording
from stages.fit_hand.facing import facing_nails
from stages.fit_hand.fingertips import Fingertips, fingertips
from stages.fit_hand.fit import fit_hand
from stages.fit_hand.posed_tables import posed_blocks
from stages.fit_hand.replaying import pose_hand
from stages.measure_movement.movement_rows import distance_rows, path_rows, range_rows
from stages.measure_movement.recorded_movement import ANGLES, ERRORS, AngleSeries, Fingertip
from stages.measure_movement.sampling import grid_of
from stages.simulate.random_hand import BONES, DIGITS
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import LAYOUT, Simulated, simulate

HANDS = ("right", "left")
SUBJECT, CALIBRATION, TASKS = "01", "rom", ("opposition", "rom")
Numbers = dict[tuple[str, str], list[tuple[float, float, float]]]
"""Of a task and a quantity: the true value, the error and the error stated."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    add_people(parser)


def run(seeds: Sequence[int]) -> Iterator[TextTable]:
    """Give the table over both hands of the people of those seeds."""
    numbers: Numbers = {}
    for seed in seeds:
        for side in HANDS:
            _add_hand(numbers, seed, side)
    rows: list[tuple[Cell, ...]] = []
    for (task, quantity), found in sorted(numbers.items()):
        true, off, sd = np.array(found).T
        rms = (float(np.sqrt(np.mean(own**2))) for own in (off, sd))
        within = 100 * float(np.mean(np.abs(off) < 1.96 * sd))
        rows.append((task, quantity, len(true), float(np.median(true)), *rms, within))
    columns = ("task", "quantity", "n:d", "true median:.1f", "rms error:.2f", "stated sd:.2f", "held %:.1f")
    meaning = (
        f"{2 * len(seeds)} simulated hands (seeds {min(seeds)} to {max(seeds)}, right and left), whole "
        f"hand fitted to {CALIBRATION}. Degrees of angles of all joints, mm of all fingertips. Stated sd: "
        "root mean square; held: errors within 1.96 of it."
    )
    yield TextTable("movement of a whole hand", columns, rows, meaning)


def _add_hand(numbers: Numbers, seed: int, side: str) -> None:
    layout = read_layout(LAYOUT)
    made = {task: simulate(SUBJECT, side, task, seed, Realism.full()) for task in TASKS}
    tips = fingertips(fit_hand([made[CALIBRATION].poses()], layout, side))
    for task, own in made.items():
        with TemporaryDirectory() as folder:
            path = _imported(own, Path(folder))
            poses = read_poses(path, layout.measured)
            blocks = list(posed_blocks(tips, path))
        angles, true_deg = _angles(blocks), _true_angles_deg(tips, poses, own)
        for quantity, number in (*_range_numbers(angles, true_deg), *_tip_numbers(blocks, poses, own)):
            numbers.setdefault((task, quantity), []).append(number)


def _imported(made: Simulated, folder: Path) -> Path:
    recording, table = folder / "recording.parquet", folder / "poses.parquet"
    write_recording(recording, made)
    names = ("--layout", LAYOUT, "--subject", SUBJECT, "--hand", made.hand, "--task", made.task)
    with redirect_stderr(StringIO()):  # it says what it finds
        assert import_recording.main(["--in", str(recording), "--out", str(table), *names]) == 0
    return table


def _columns(
    blocks: Sequence[dict[str, dict[str, Array]]], table: str, by: str, names: Sequence[str]
) -> dict[str, Array]:
    """Columns (T, C) of a table by joint or digit."""
    import pyarrow as pa

    pieces = [
        numbers_by_name(pa.table({name: pa.array(block[table][name]) for name in (by, *names)}), by, names)
        for block in blocks
    ]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def _angles(blocks: Sequence[dict[str, dict[str, Array]]]) -> Iterator[AngleSeries]:
    for angle in ANGLES:
        names = [f"{angle}_{what}" for what in ("deg", *ERRORS)]
        of = _columns(blocks, "joint_angles", "joint", names)
        stacked = np.stack([*of.values()], 1)
        yield AngleSeries(angle, tuple(of), stacked[..., 0], stacked[..., 1:])


def _true_angles_deg(tips: Fingertips, poses: Poses, made: Simulated) -> dict[str, Array]:
    fit = tips.fit
    posed = pose_hand(fit, poses.take(slice(0, 1)))
    places = [BONES.index(name) for name in posed.bones]
    true = replace(posed, bone_quaternion=made.truth.bone_quaternion[:, places])
    bones, rests = facing_nails(fit, true)
    return angles_of_hand(posed.bones, bones, bones[:, 0], fit.evidence.layout, made.hand, rests)


def _range_numbers(
    angles: Iterator[AngleSeries], true_deg: dict[str, Array]
) -> Iterator[tuple[str, tuple[float, float, float]]]:
    for index, series in enumerate(angles):
        for row in range_rows(series, None, dict.fromkeys(series.joints, ("ok", ""))):
            low, middle, high = np.percentile(
                true_deg[row["joint"]][:, index], [LOW_PERCENT, 50.0, HIGH_PERCENT]
            )
            true, name = high - low, series.angle
            yield f"range of {name}", (true, row["range_deg"] - true, row["range_sd_deg"])
            yield "range", (true, row["range_deg"] - true, row["range_sd_deg"])
            yield f"median of {name}", (middle, row["median_deg"] - middle, row["median_sd_deg"])


def _tip_numbers(
    blocks: Sequence[dict[str, dict[str, Array]]], poses: Poses, made: Simulated
) -> Iterator[tuple[str, tuple[float, float, float]]]:
    names = ("skin_tip_x_mm", "skin_tip_y_mm", "skin_tip_z_mm", "skin_tip_sd_mm")
    found = _columns(blocks, "posed_tips", "digit", names)
    grid, bone = grid_of(poses.time_s), BONES.index("hand")
    pose = _columns(blocks, "bone_poses", "segment", ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"))["hand"]
    seen = pose[:, :3], pose[:, 3:]
    true = made.truth.bone_position_mm[:, bone], made.truth.bone_quaternion[:, bone]
    tips, true_tips = {}, {}
    for index, digit in enumerate(DIGITS):
        sd_mm = found[digit][:, 3]
        turn = poses.quaternion[:, poses.index(f"{digit}_distal")]
        tips[digit] = _tip(found[digit][:, :3], turn, seen, sd_mm)
        last = made.truth.bone_quaternion[:, BONES.index(f"{digit}_distal")]
        true_tips[digit] = _tip(made.truth.skin_tip_mm[:, index], last, true, sd_mm)
    for quantity, rows in (
        ("path", zip(path_rows(tips, grid), path_rows(true_tips, grid), strict=True)),
        ("distance", zip(distance_rows(tips, grid), distance_rows(true_tips, grid), strict=True)),
    ):
        for row, own in rows:
            name, sd = (
                ("path_length_mm", "path_sd_mm") if quantity == "path" else ("median_mm", "distance_sd_mm")
            )
            yield quantity, (own[name], row[name] - own[name], row[sd])


def _tip(place_mm: Array, turn: Array, hand: tuple[Array, Array], sd_mm: Array) -> Fingertip:
    """A fingertip in the frame of a hand at places (T, 3) with rotations (T, 4)."""
    back = conjugate(hand[1])
    pointing = rotate(turn, np.array([1.0, 0.0, 0.0]))
    return Fingertip(rotate(back, place_mm - hand[0]), rotate(back, pointing), sd_mm, skin=True)
