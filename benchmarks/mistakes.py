"""Mistakes planted in simulated hands: how often each is named, and false alarms on hands without one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks import faultless_hands
from benchmarks.benchmark_table import PrintedTable, Row, of_each_person, percent
from benchmarks.faultless_hands import Planted, changed
from shukotsu.checks.checked_recording import CheckedRecording, check_recording
from shukotsu.checks.checked_subject import compare_recordings
from shukotsu.checks.hypotheses import Declared
from shukotsu.hand.rotations import Array, about_axis, conjugate, from_matrix, matrix, multiply, unit
from shukotsu.simulate.random_hand import FINGERS
from shukotsu.simulate.simulation import LAYOUT
from shukotsu.study.layout import read_layout

WRITTEN_TO = "mistakes-benchmark.md", "tables"
PEOPLE = 30, 9000
PAIRS = 4

Tally = tuple[str, str, bool, bool]
"""Simulator; planted mistake; whether it is named first; whether it is named at all."""

Alarm = tuple[str, str, tuple[str, ...]]
"""Simulator; peculiarity; kinds of the false alarms."""

Mistake = Callable[[Planted, np.random.Generator], Planted]


def run(n_hands: int, seed: int) -> Iterator[PrintedTable]:
    """Yield the tables over n_hands people."""
    alarms, single, pairs = (
        [row for rows in part for row in rows]
        for part in zip(*of_each_person(one_person, n_hands, seed), strict=True)
    )
    once = f"{n_hands} people; every mistake once per person, with the affected receivers drawn at random."
    both = "First: one of the two is named first. At all: both are named."
    yield _table("One mistake", single, once)
    yield _table("Two mistakes at once", pairs, both)
    yield _alarm_table(alarms)


def one_person(seed: int) -> tuple[list[Alarm], list[Tally], list[Tally]]:
    """Check a person's recordings without a mistake, with one, and with two."""
    rng = np.random.default_rng(seed)
    hand = ("right", "left")[seed // 2 % 2]
    alarms = [
        (drawing, name, tuple(finding.kind for finding in planted.findings()))
        for drawing, name, planted in faultless_hands.faultless(seed, hand, rng)
    ]
    single, pairs = [], []
    for drawing, record in RECORDERS.items():
        plain = record(seed, hand, ("rom", "opposition")[seed % 2])
        for name, (kind, mistake) in MISTAKES.items():
            kinds = [finding.kind for finding in mistake(plain, rng).findings()]
            single.append((drawing, f"{kind}: {name}", kinds[:1] == [kind], kind in kinds))
        single += [(drawing, *tally) for tally in _several(seed, hand, record)]
        pairs += [(drawing, *_pair(plain, rng)) for _ in range(PAIRS)]
    return alarms, single, pairs


Recorder = Callable[[int, str, str], Planted]
RECORDERS: Mapping[str, Recorder] = {"own": faultless_hands.own_hand, "other": faultless_hands.other_hand}


def _pair(plain: Planted, rng: np.random.Generator) -> tuple[str, bool, bool]:
    names = [name for name, (kind, _) in MISTAKES.items() if kind not in ("too-short", "euler-order")]
    while True:
        first, second = (MISTAKES[names[i]] for i in rng.choice(len(names), 2, replace=False))
        if first[0] != second[0] and not {first[0], second[0]} <= EQUIVALENT:
            break
    kinds = [finding.kind for finding in second[1](first[1](plain, rng), rng).findings()]
    both = {first[0], second[0]}
    return "two of different kinds", bool(kinds) and kinds[0] in both, both <= {*kinds}


EQUIVALENT = frozenset({"wrong-hand", "axes-mirrored", "receiver-turned", "hemisphere"})
"""Kinds of which two together may be equivalent to a third: negated positions of the other hand look like all
receivers turned."""


def _several(seed: int, hand: str, record: Recorder) -> list[tuple[str, bool, bool]]:
    """Plant mistakes that only several recordings together show: the last of three is wrong."""
    rows = []
    recordings = [(task, hand, _check(record(seed, hand, task))) for task in ("rom", "opposition")]
    for kind, last in (
        ("same-file", recordings[0][2]),
        ("other-person", _check(record(seed + 500, hand, "opposition"))),
    ):
        named = compare_recordings([*recordings, ("again", hand, last)])
        kinds = [[finding.kind for finding in recording.findings] for recording in named]
        rows.append((f"{kind}: third of three", kinds[2][:1] == [kind], kind in kinds[2]))
    return rows


def _check(planted: Planted) -> CheckedRecording:
    return check_recording(planted.poses, read_layout(LAYOUT), planted.hand)


# --- mistakes ---------------------------------------------------------------------------------------------


def _quaternions(change: Callable[[Array], Array], order: str = "wxyz") -> Mistake:
    def plant(planted: Planted, _: np.random.Generator) -> Planted:
        wrong = changed(planted, quaternion=change(planted.poses.quaternion))
        return replace(wrong, declared=replace(planted.declared, order=order))

    return plant


def _positions(
    factor: float | Sequence[float], order: Sequence[int] = (0, 1, 2), unit: str = "mm"
) -> Mistake:
    columns, factors = list(order), np.array(factor)

    def plant(planted: Planted, _: np.random.Generator) -> Planted:
        wrong = changed(planted, position_mm=planted.poses.position_mm[..., columns] * factors)
        return replace(wrong, declared=replace(planted.declared, position_unit=unit))

    return plant


def _times(factor: float) -> Mistake:
    return lambda planted, _: changed(planted, time_s=planted.poses.time_s * factor)


def _exchange_receivers(pairs: Callable[[np.random.Generator], Sequence[tuple[str, str]]]) -> Mistake:
    """Exchange the segments of receivers."""

    def plant(planted: Planted, rng: np.random.Generator) -> Planted:
        return replace(planted, poses=faultless_hands.exchange_receivers(planted.poses, *pairs(rng)))

    return plant


BONES = ("proximal", "middle", "distal")


def _near(rng: np.random.Generator) -> list[tuple[str, str]]:
    finger, first = FINGERS[rng.integers(4)], rng.integers(2)
    return [(f"{finger}_{BONES[first]}", f"{finger}_{BONES[first + 1]}")]


def _on_thumb(rng: np.random.Generator) -> list[tuple[str, str]]:
    bones = ("metacarpal", "proximal", "distal")
    first = rng.integers(2)
    return [(f"thumb_{bones[first]}", f"thumb_{bones[first + 1]}")]


def _far(rng: np.random.Generator) -> list[tuple[str, str]]:
    fingers, bones = rng.choice(4, 2, replace=False), rng.choice([*BONES], 2)
    first, second = (f"{FINGERS[i]}_{bone}" for i, bone in zip(fingers, bones, strict=True))
    return [(first, second)]


def _neighbours(rng: np.random.Generator) -> list[tuple[str, str]]:
    first = int(rng.integers(3))
    return [(f"{FINGERS[first]}_{bone}", f"{FINGERS[first + 1]}_{bone}") for bone in BONES]


def _reversal_pairs(_: np.random.Generator) -> list[tuple[str, str]]:
    ends = (("index", "little"), ("middle", "ring"))
    return [(f"{a}_{bone}", f"{b}_{bone}") for a, b in ends for bone in BONES]


def _turn_receiver(degrees: float) -> Mistake:
    """Turn a receiver about one of its axes; not the thumb metacarpal's, which may face in any direction."""

    def plant(planted: Planted, rng: np.random.Generator) -> Planted:
        quaternion = planted.poses.quaternion.copy()
        segments = [name for name in planted.poses.segments if name != "thumb_metacarpal"]
        receiver = planted.poses.index(str(rng.choice(segments)))
        turn = about_axis(np.eye(3)[rng.integers(3)], np.radians(degrees * rng.choice([-1, 1])))
        quaternion[:, receiver] = multiply(quaternion[:, receiver], turn)
        return changed(planted, quaternion=quaternion)

    return plant


def _all_turned(planted: Planted, rng: np.random.Generator) -> Planted:
    turn = about_axis(np.eye(3)[rng.integers(3)], np.radians(rng.choice([90.0, 180.0])))
    return changed(planted, quaternion=multiply(planted.poses.quaternion, turn))


def _other_side(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    position[:, rng.integers(position.shape[1])] *= -1
    return changed(planted, position_mm=position)


def _flips(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    for receiver in rng.choice(position.shape[1], rng.integers(1, 4), replace=False):
        for start in rng.integers(0, len(position), 2):
            position[start : start + rng.integers(20, 600), receiver] *= -1
    return changed(planted, position_mm=position)


def _spikes(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    for _ in range(rng.integers(1, 5)):
        far = unit(rng.normal(size=3)) * 10 ** rng.uniform(2, 4)
        position[rng.integers(5, len(position) - 5), rng.integers(position.shape[1])] += far
    return changed(planted, position_mm=position)


def _random_poses(planted: Planted, rng: np.random.Generator) -> Planted:
    position = rng.normal(0, 200, planted.poses.position_mm.shape)
    quaternion = unit(rng.normal(size=planted.poses.quaternion.shape))
    return changed(planted, position_mm=position, quaternion=quaternion)


def _hangs(planted: Planted, rng: np.random.Generator) -> Planted:
    poses, receiver = planted.poses, rng.integers(1, 16)
    start = rng.integers(0, len(poses.frame) - 300)
    rows = slice(start, start + rng.integers(150, 300))
    position, quaternion = poses.position_mm.copy(), poses.quaternion.copy()
    position[rows, receiver] = position[start, receiver]
    quaternion[rows, receiver] = quaternion[start, receiver]
    return changed(planted, position_mm=position, quaternion=quaternion)


def _other_hand(planted: Planted, _: np.random.Generator) -> Planted:
    return replace(planted, hand="left" if planted.hand == "right" else "right")


def _cut(planted: Planted, rng: np.random.Generator) -> Planted:
    return replace(planted, poses=planted.poses.take(slice(0, int(rng.integers(2, 40)))))


def _angles_misread(planted: Planted, rng: np.random.Generator) -> Planted:
    true, read = rng.choice(["".join(order) for order in permutations("XYZ")], 2, replace=False)
    return _with_angles(planted, _angles(planted.poses.quaternion, str(true)), str(read), "deg")


def _angle_unit(unit: str) -> Mistake:
    """Declare this unit for angles that are in the other one."""

    def plant(planted: Planted, _: np.random.Generator) -> Planted:
        convert = np.radians if unit == "deg" else np.degrees
        return _with_angles(planted, convert(_angles(planted.poses.quaternion, "ZYX")), "ZYX", unit)

    return plant


def _angles(quaternion: Array, axes: str) -> Array:
    """Return intrinsic Euler angles (..., 3), rad."""
    turn = Rotation.from_matrix(matrix(quaternion).reshape(-1, 3, 3))
    return np.asarray(turn.as_euler(axes).reshape(*quaternion.shape[:-1], 3))


def _with_angles(planted: Planted, angles_rad: Array, axes: str, unit: str) -> Planted:
    """Replace rotations by those of intrinsic Euler angles, and declare these axes and this unit."""
    turn = Rotation.from_euler(axes, angles_rad.reshape(-1, 3)).as_matrix()
    quaternion = from_matrix(turn.reshape(*angles_rad.shape[:-1], 3, 3))
    declared = Declared("csv", kind="euler", axes=axes, angle_unit=unit)
    return replace(changed(planted, quaternion=quaternion), declared=declared)


MISTAKES: Mapping[str, tuple[str, Mistake]] = {
    "x, y, z, w read as w, x, y, z": ("quaternion-order", _quaternions(lambda q: q[..., [1, 2, 3, 0]])),
    "w, x, y, z read as x, y, z, w": (
        "quaternion-order",
        _quaternions(lambda q: q[..., [3, 0, 1, 2]], order="xyzw"),
    ),
    "inverse rotations": ("quaternion-inverse", _quaternions(conjugate)),
    "other axes of angles": ("euler-order", _angles_misread),
    "radians read as degrees": ("units", _angle_unit("deg")),
    "degrees read as radians": ("units", _angle_unit("rad")),
    "metres read as mm": ("units", _positions(1 / 1000)),
    "centimetres read as mm": ("units", _positions(1 / 10)),
    "inches read as cm": ("units", _positions(1 / 2.54, unit="cm")),
    "cm read as inches": ("units", _positions(2.54, unit="inch")),
    "milliseconds read as seconds": ("time-unit", _times(1e3)),
    "seconds read as milliseconds": ("time-unit", _times(1e-3)),
    "a receiver on the other side all along": ("hemisphere", _other_side),
    "one to three receivers flip": ("hemisphere", _flips),
    "a receiver hangs for a while": ("receiver-stuck", _hangs),
    "one to four rows 0.1 to 10 m off": ("spikes", _spikes),
    "random poses": ("spikes", _random_poses),
    "neighbours on a finger": ("receivers-swapped", _exchange_receivers(_near)),
    "neighbours on the thumb": ("receivers-swapped", _exchange_receivers(_on_thumb)),
    "on two fingers": ("receivers-swapped", _exchange_receivers(_far)),
    "neighbouring fingers": ("digits-swapped", _exchange_receivers(_neighbours)),
    "fingers in the opposite order": ("digits-swapped", _exchange_receivers(_reversal_pairs)),
    "the other hand": ("wrong-hand", _other_hand),
    "positions negated": ("hemisphere", _positions(-1)),
    "one axis negated": ("axes-mirrored", _positions((1, -1, 1))),
    "axes in another order": ("axes-mirrored", _positions(1, (1, 2, 0))),
    "y up and z up mixed": ("axes-mirrored", _positions((1, 1, -1), (0, 2, 1))),
    "a receiver by 90 deg": ("receiver-turned", _turn_receiver(90)),
    "a receiver by 180 deg": ("receiver-turned", _turn_receiver(180)),
    "all receivers": ("receiver-turned", _all_turned),
    "2 to 39 frames": ("too-short", _cut),
}
"""Planted mistakes by name, with the kind of the expected finding and the function that plants it."""


def _table(title: str, tallies: Sequence[Tally], meaning: str) -> PrintedTable:
    names = [*dict.fromkeys(name for _, name, _, _ in tallies)]
    rows = [_shares(name, [row for row in tallies if row[1] == name]) for name in names]
    rows += [_shares("all", tallies)] if len(rows) > 1 else []
    shares = [f"{what}, {drawing} %:.1f" for drawing in RECORDERS for what in ("first", "at all")]
    return PrintedTable(title, ("planted", "hands:d", *shares), rows, meaning)


def _shares(name: str, tallies: Sequence[Tally]) -> Row:
    by_drawing = {drawing: [row for row in tallies if row[0] == drawing] for drawing in RECORDERS}
    shares = [percent([row[i] for row in rows]) for rows in by_drawing.values() for i in (2, 3)]
    return (name, len(tallies) // len(by_drawing), *shares)


def _alarm_table(alarms: Sequence[Alarm]) -> PrintedTable:
    groups: dict[tuple[str, str], list[tuple[str, ...]]] = {}
    for drawing, name, kinds in alarms:
        groups.setdefault((drawing, name), []).append(kinds)
        groups.setdefault((drawing, "all"), []).append(kinds)
    rows: list[Row] = []
    for (drawing, name), of_hands in sorted(groups.items()):
        counts = sorted(Counter(kind for kinds in of_hands for kind in kinds).items())
        named = ", ".join(f"{kind} {count}" for kind, count in counts)
        rows.append((drawing, name, len(of_hands), sum(map(bool, of_hands)), named))
    columns = ("drawing", "hand", "recordings:d", "suspect:d", "kinds")
    share = 1000 * float(np.mean([bool(kinds) for _, _, kinds in alarms]))
    meaning = f"Of 1000 recordings without a mistake, {share:.1f} are reported as suspect."
    return PrintedTable("False alarms", columns, rows, meaning)
