"""Mistakes planted in simulated hands: how often each is named, and false alarms on hands without one."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import permutations
from multiprocessing import get_context
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.believed_joints import Believed, believed_joints, believed_table
from benchmarks.benchmark_table import Cell, TextTable, write_tables
from checks.checked_recording import check_recording
from checks.compared_recordings import compared
from checks.declared import TIDY, Declared
from schemas.findings import NOTE, Finding
from schemas.layout import read_layout
from schemas.poses import Poses
from skeleton.rotations import Array, about_axis, conjugate, from_matrix, matrix, multiply, unit
from stages.simulate import random_hand, task_motion
from stages.simulate.random_hand import JOINTS, Hand
from stages.simulate.realism import Realism
from stages.simulate.simulated_truth import TrueJoint
from stages.simulate.simulation import LAYOUT, simulate

PAGE = "mistakes-benchmark.md"
FIRST_SEED = 6000
FRAMES = {"rom": 1800, "opposition": 1200}
PAIRS = 4
FINGERS = ("index", "middle", "ring", "little")

Tally = tuple[str, bool, bool]
"""What was planted or varied; whether named first (of a faultless hand: any alarm); whether named at all."""


@dataclass(frozen=True)
class Planted:
    """Poses after a mistake, the hand as declared, what the mapping says of the numbers, the true joints."""

    poses: Poses
    hand: str
    declared: Declared = TIDY
    truth: Mapping[str, TrueJoint] = field(default_factory=dict)

    def findings(self) -> list[Finding]:
        """Give what is found, notes left out but those of receivers that hang."""
        found = check_recording(self.poses, read_layout(LAYOUT), self.hand, self.declared).findings
        return [one for one in found if one.severity != NOTE or one.kind == "receiver-stuck"]


@dataclass(frozen=True)
class Person:
    """Of one: tallies of alarms, of one mistake, of mistakes among several recordings and of two at once."""

    tallies: tuple[list[Tally], list[Tally], list[Tally], list[Tally]]
    believed: list[Believed]


Mistake = Callable[[Planted, np.random.Generator], Planted]


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--hands", dest="n_hands", type=int, default=30, help="simulated people (30)")
    parser.add_argument("--write", action="store_true", help=f"put the tables into docs/{PAGE}")


def run(n_hands: int = 30, write: bool = False, processes: int = 2) -> Iterator[TextTable]:
    """Give the tables over that many people, seeds from FIRST_SEED on."""
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        people = list(pool.map(one_person, range(FIRST_SEED, FIRST_SEED + n_hands)))
    tables = tables_of(people)
    yield from tables
    if write:
        write_tables(PAGE, tables, f"python -m benchmarks mistakes --hands {n_hands} --write")


def tables_of(people: Sequence[Person]) -> list[TextTable]:
    """Give the tables of what `one_person` gives of each."""
    alarms, single, several, pairs = (
        [row for person in people for row in person.tallies[i]] for i in range(4)
    )
    return [
        _table(
            "One mistake",
            [*single, *several],
            f"{len(people)} people; every mistake once each, what it concerns drawn at random.",
        ),
        _table("Two mistakes at once", pairs, "First: one of the two is named first. All: both are named."),
        _alarm_table(alarms),
        believed_table([row for person in people for row in person.believed]),
    ]


def one_person(seed: int) -> Person:
    """Give the false alarms of a person's recordings, what was said of mistakes in them, and what is ok."""
    rng = np.random.default_rng(seed)
    task, hand = ("rom", "opposition")[seed % 2], ("right", "left")[seed // 2 % 2]
    odd = [(f"{name}, {own}", one) for own in FRAMES for name, one in faultless(seed, hand, own, rng)]
    alarms = [(name, bool(planted.findings()), False) for name, planted in odd]
    believed = [
        row
        for name, planted in odd
        for row in believed_joints(name, planted.poses, planted.hand, planted.truth)
    ]
    plain = _planted(seed, hand, task)
    single = []
    for name, (kind, mistake) in MISTAKES.items():
        kinds = [one.kind for one in mistake(plain, rng).findings()]
        single.append((f"{kind}: {name}", kinds[:1] == [kind], kind in kinds))
    pairs = [_pair(plain, rng) for _ in range(PAIRS)]
    return Person((alarms, single, _several(seed, hand), pairs), believed)


def _pair(plain: Planted, rng: np.random.Generator) -> Tally:
    names = [name for name, (kind, _) in MISTAKES.items() if kind not in ("too-short", "euler-order")]
    while True:
        first, second = (MISTAKES[names[i]] for i in rng.choice(len(names), 2, replace=False))
        if first[0] != second[0] and not {first[0], second[0]} <= EQUIVALENT:
            break
    found = [one.kind for one in second[1](first[1](plain, rng), rng).findings()]
    both = {first[0], second[0]}
    return "two of different kinds", bool(found) and found[0] in both, both <= {*found}


EQUIVALENT = frozenset({"wrong-hand", "axes-mirrored", "receiver-turned"})
"""Kinds two of which may come to a third: positions negated of the other hand are all receivers turned."""


def _several(seed: int, hand: str) -> list[Tally]:
    """Mistakes that show in a subject's recordings together: of three, the last is wrong."""
    rows = []
    tasks = {"rom": "rom", "grip": "opposition"}
    own = [(name, hand, _check(_planted(seed, hand, task))) for name, task in tasks.items()]
    for kind, last in (
        ("same-file", own[0][2]),
        ("other-person", _check(_planted(seed + 500, hand, "opposition"))),
    ):
        named = compared([*own, ("again", hand, last)])
        kinds = [[one.kind for one in recording.findings] for recording in named]
        rows.append((f"{kind}: third of three", kinds[2][:1] == [kind], kind in kinds[2]))
    return rows


def _check(planted: Planted) -> Any:
    return check_recording(planted.poses, read_layout(LAYOUT), planted.hand)


# --- hands without a fault --------------------------------------------------------------------------------


def faultless(seed: int, hand: str, task: str, rng: np.random.Generator) -> Iterator[tuple[str, Planted]]:
    """Give hands that are odd and right."""
    plain = _planted(seed, hand, task)
    yield "usual hand", plain
    yield "very small hand (0.68 times)", _scaled(plain, 0.68)
    yield "very large hand (1.22 times)", _scaled(plain, 1.22)
    yield "loose receivers (skin 3 times)", _planted(seed, hand, task, artefact=3.0)
    yield "dropouts, one receiver dead", _with_dropouts(plain, rng)
    yield "with a receiver on the forearm", _planted(seed, hand, task, forearm=True)
    yield "stiff finger joints (a tenth)", _stiff(seed, hand, task, ("pip", "dip"))
    yield "stiff thumb and index (a tenth)", _stiff(seed, hand, task, ("thumb", "index"))
    yield "deformed (ulnar drift, a short bone)", _deformed(seed, hand, task, rng)


def _planted(seed: int, hand: str, task: str, *, artefact: float = 1.0, forearm: bool = False) -> Planted:
    made = simulate("01", hand, task, seed, Realism(artefact=artefact), FRAMES[task], forearm=forearm)
    valid = np.ones(made.position_mm.shape[:2], bool)
    poses = Poses(made.segments, made.frame, made.time_s, made.position_mm, made.quaternion, valid)
    return Planted(poses, hand, truth=made.truth.joints)


def _scaled(planted: Planted, factor: float) -> Planted:
    truth = {
        name: replace(joint, parent_mm=factor * joint.parent_mm, child_mm=factor * joint.child_mm)
        for name, joint in planted.truth.items()
    }
    return replace(_with(planted, position_mm=planted.poses.position_mm * factor), truth=truth)


def _with(planted: Planted, **arrays: Any) -> Planted:
    return replace(planted, poses=replace(planted.poses, **arrays))


def _with_dropouts(planted: Planted, rng: np.random.Generator) -> Planted:
    valid = planted.poses.valid.copy()
    for place in range(valid.shape[1]):
        for start in rng.integers(0, len(valid), 4):
            valid[start : start + rng.integers(5, 200), place] = False
    valid[:, rng.integers(1, valid.shape[1])] = False
    gone = ~valid[..., None]
    poses = planted.poses
    return _with(
        planted,
        valid=valid,
        position_mm=np.where(gone, np.nan, poses.position_mm),
        quaternion=np.where(gone, np.nan, poses.quaternion),
    )


def _stiff(seed: int, hand: str, task: str, joints: Sequence[str]) -> Planted:
    """Those joints move a tenth of what they would."""

    def move(*args: Any) -> Any:
        motion = task_motion.move(*args)
        angles = motion.angles_rad.copy()
        for place in (i for i, name in enumerate(JOINTS) if any(part in name for part in joints)):
            angles[:, place] = angles[0, place] + 0.1 * (angles[:, place] - angles[0, place])
        return replace(motion, angles_rad=angles)

    with mock.patch("stages.simulate.simulation.move", move):
        return _planted(seed, hand, task)


def _deformed(seed: int, hand: str, task: str, rng: np.random.Generator) -> Planted:
    """Fingers that drift to the ulna by 20 deg, and a phalanx a quarter shorter."""
    short = int(rng.integers(7, 21))

    def hand_of(*args: Any) -> Hand:
        own = random_hand.hand_of(*args)
        length, rest = own.length_mm.copy(), own.rest.copy()
        length[short] *= 0.75
        drift = about_axis(np.array([0.0, 0.0, -1.0 if own.side == "right" else 1.0]), np.radians(20.0))
        for place in (JOINTS.index(f"{finger}_mcp") for finger in FINGERS):
            rest[place] = multiply(rest[place], drift)
        return replace(own, length_mm=length, rest=rest)

    with mock.patch("stages.simulate.simulation.hand_of", hand_of):
        return _planted(seed, hand, task)


# --- mistakes ---------------------------------------------------------------------------------------------


def _quaternions(change: Callable[[Array], Array]) -> Mistake:
    return lambda planted, _: _with(planted, quaternion=change(planted.poses.quaternion))


def _positions(factor: float | Sequence[float], order: Sequence[int] = (0, 1, 2)) -> Mistake:
    columns, factors = list(order), np.array(factor)
    return lambda planted, _: _with(planted, position_mm=planted.poses.position_mm[..., columns] * factors)


def _times(factor: float) -> Mistake:
    return lambda planted, _: _with(planted, time_s=planted.poses.time_s * factor)


def _exchanged(pairs: Callable[[np.random.Generator], Sequence[tuple[str, str]]]) -> Mistake:
    """Receivers stand for each other's segments."""

    def plant(planted: Planted, rng: np.random.Generator) -> Planted:
        poses = planted.poses
        order = list(range(len(poses.segments)))
        for one, other in pairs(rng):
            i, j = poses.index(one), poses.index(other)
            order[i], order[j] = j, i
        return _with(
            planted,
            position_mm=poses.position_mm[:, order],
            quaternion=poses.quaternion[:, order],
            valid=poses.valid[:, order],
        )

    return plant


def _near(rng: np.random.Generator) -> list[tuple[str, str]]:
    finger, bones = FINGERS[rng.integers(4)], ("proximal", "middle", "distal")
    first = rng.integers(2)
    return [(f"{finger}_{bones[first]}", f"{finger}_{bones[first + 1]}")]


def _on_thumb(rng: np.random.Generator) -> list[tuple[str, str]]:
    bones = ("metacarpal", "proximal", "distal")
    first = rng.integers(2)
    return [(f"thumb_{bones[first]}", f"thumb_{bones[first + 1]}")]


def _far(rng: np.random.Generator) -> list[tuple[str, str]]:
    one, other = rng.choice(4, 2, replace=False)
    bones = rng.choice(["proximal", "middle", "distal"], 2)
    return [(f"{FINGERS[one]}_{bones[0]}", f"{FINGERS[other]}_{bones[1]}")]


def _neighbours(rng: np.random.Generator) -> list[tuple[str, str]]:
    first = int(rng.integers(3))
    return [
        (f"{FINGERS[first]}_{bone}", f"{FINGERS[first + 1]}_{bone}")
        for bone in ("proximal", "middle", "distal")
    ]


def _reversed(_: np.random.Generator) -> list[tuple[str, str]]:
    ends = (("index", "little"), ("middle", "ring"))
    return [(f"{a}_{bone}", f"{b}_{bone}") for a, b in ends for bone in ("proximal", "middle", "distal")]


def _turned(degrees: float) -> Mistake:
    """A receiver turned about one of its axes."""

    def plant(planted: Planted, rng: np.random.Generator) -> Planted:
        quaternion = planted.poses.quaternion.copy()
        place = rng.integers(quaternion.shape[1])
        turn = about_axis(np.eye(3)[rng.integers(3)], np.radians(degrees * rng.choice([-1, 1])))
        quaternion[:, place] = multiply(quaternion[:, place], turn)
        return _with(planted, quaternion=quaternion)

    return plant


def _all_turned(planted: Planted, rng: np.random.Generator) -> Planted:
    turn = about_axis(np.eye(3)[rng.integers(3)], np.radians(rng.choice([90.0, 180.0])))
    return _with(planted, quaternion=multiply(planted.poses.quaternion, turn))


def _other_side(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    position[:, rng.integers(position.shape[1])] *= -1
    return _with(planted, position_mm=position)


def _flips(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    for place in rng.choice(position.shape[1], rng.integers(1, 4), replace=False):
        for start in rng.integers(0, len(position), 2):
            position[start : start + rng.integers(20, 600), place] *= -1
    return _with(planted, position_mm=position)


def _spikes(planted: Planted, rng: np.random.Generator) -> Planted:
    position = planted.poses.position_mm.copy()
    for _ in range(rng.integers(1, 5)):
        far = unit(rng.normal(size=3)) * 10 ** rng.uniform(2, 4)
        position[rng.integers(5, len(position) - 5), rng.integers(position.shape[1])] += far
    return _with(planted, position_mm=position)


def _random_poses(planted: Planted, rng: np.random.Generator) -> Planted:
    poses = planted.poses
    return _with(
        planted,
        position_mm=rng.normal(0, 200, poses.position_mm.shape),
        quaternion=unit(rng.normal(size=poses.quaternion.shape)),
    )


def _hangs(planted: Planted, rng: np.random.Generator) -> Planted:
    poses, place = planted.poses, rng.integers(1, 16)
    start = rng.integers(0, len(poses.frame) - 300)
    rows = slice(start, start + rng.integers(150, 300))
    position, quaternion = poses.position_mm.copy(), poses.quaternion.copy()
    position[rows, place], quaternion[rows, place] = position[start, place], quaternion[start, place]
    return _with(planted, position_mm=position, quaternion=quaternion)


def _other_hand(planted: Planted, _: np.random.Generator) -> Planted:
    return replace(planted, hand="left" if planted.hand == "right" else "right")


def _cut(planted: Planted, rng: np.random.Generator) -> Planted:
    return replace(planted, poses=planted.poses.take(slice(0, int(rng.integers(2, 40)))))


def _angles_misread(planted: Planted, rng: np.random.Generator) -> Planted:
    true, read = rng.choice(["".join(order) for order in permutations("XYZ")], 2, replace=False)
    angles = _angles(planted.poses.quaternion, str(true))
    declared = Declared("csv", kind="euler", axes=str(read), angle_unit="deg")
    return replace(_with(planted, quaternion=_composed(angles, str(read))), declared=declared)


def _radians_as_degrees(planted: Planted, _: np.random.Generator) -> Planted:
    angles = np.radians(_angles(planted.poses.quaternion, "ZYX"))
    declared = Declared("csv", kind="euler", axes="ZYX", angle_unit="deg")
    return replace(_with(planted, quaternion=_composed(angles, "ZYX")), declared=declared)


def _degrees_as_radians(planted: Planted, _: np.random.Generator) -> Planted:
    angles = np.degrees(_angles(planted.poses.quaternion, "ZYX"))
    declared = Declared("csv", kind="euler", axes="ZYX", angle_unit="rad")
    return replace(_with(planted, quaternion=_composed(angles, "ZYX")), declared=declared)


def _angles(quaternion: Array, axes: str) -> Array:
    """Angles (..., 3) in rad about moving axes."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_matrix(matrix(quaternion).reshape(-1, 3, 3))
    return np.asarray(turn.as_euler(axes).reshape(*quaternion.shape[:-1], 3))


def _composed(angles_rad: Array, axes: str) -> Array:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler(axes, angles_rad.reshape(-1, 3))
    return from_matrix(turn.as_matrix().reshape(*angles_rad.shape[:-1], 3, 3))


MISTAKES: Mapping[str, tuple[str, Mistake]] = {
    "x, y, z, w read as w, x, y, z": ("quaternion-order", _quaternions(lambda q: q[..., [1, 2, 3, 0]])),
    "w, x, y, z read as x, y, z, w": ("quaternion-order", _quaternions(lambda q: q[..., [3, 0, 1, 2]])),
    "inverse rotations": ("quaternion-inverse", _quaternions(conjugate)),
    "other axes of angles": ("euler-order", _angles_misread),
    "radians read as degrees": ("units", _radians_as_degrees),
    "degrees read as radians": ("units", _degrees_as_radians),
    "metres read as mm": ("units", _positions(1 / 1000)),
    "centimetres read as mm": ("units", _positions(1 / 10)),
    "inches read as cm": ("units", _positions(1 / 2.54)),
    "cm read as inches": ("units", _positions(2.54)),
    "milliseconds read as seconds": ("time-unit", _times(1e3)),
    "seconds read as milliseconds": ("time-unit", _times(1e-3)),
    "a receiver on the other side all along": ("hemisphere", _other_side),
    "one to three receivers flip": ("hemisphere", _flips),
    "a receiver hangs for a while": ("receiver-stuck", _hangs),
    "one to four rows 0.1 to 10 m off": ("spikes", _spikes),
    "random poses": ("spikes", _random_poses),
    "neighbours on a finger": ("receivers-swapped", _exchanged(_near)),
    "neighbours on the thumb": ("receivers-swapped", _exchanged(_on_thumb)),
    "on two fingers": ("receivers-swapped", _exchanged(_far)),
    "neighbouring fingers": ("digits-swapped", _exchanged(_neighbours)),
    "fingers in the opposite order": ("digits-swapped", _exchanged(_reversed)),
    "the other hand": ("wrong-hand", _other_hand),
    "positions negated": ("axes-mirrored", _positions(-1)),
    "one axis negated": ("axes-mirrored", _positions((1, -1, 1))),
    "axes in another order": ("axes-mirrored", _positions(1, (1, 2, 0))),
    "y up and z up mixed": ("axes-mirrored", _positions((1, 1, -1), (0, 2, 1))),
    "a receiver by 90 deg": ("receiver-turned", _turned(90)),
    "a receiver by 180 deg": ("receiver-turned", _turned(180)),
    "all receivers": ("receiver-turned", _all_turned),
    "2 to 39 frames": ("too-short", _cut),
}
"""By name: the kind, and what plants it."""


def _table(title: str, tallies: Sequence[Tally], meaning: str) -> TextTable:
    by_name: dict[str, list[Tally]] = {}
    for tally in tallies:
        by_name.setdefault(tally[0], []).append(tally)
    rows = [_shares(name, own) for name, own in by_name.items()]
    rows += [_shares("all", tallies)] if len(rows) > 1 else []
    columns = ("planted", "hands:d", "named first %:.1f", "named at all %:.1f")
    return TextTable(title, columns, rows, meaning)


def _shares(name: str, tallies: Sequence[Tally]) -> tuple[Cell, ...]:
    return (name, len(tallies), *(100 * float(np.mean([tally[i] for tally in tallies])) for i in (1, 2)))


def _alarm_table(tallies: Sequence[Tally]) -> TextTable:
    by_name: dict[str, list[bool]] = {}
    for name, alarm, _ in tallies:
        by_name.setdefault(name, []).append(alarm)
    rows: list[tuple[Cell, ...]] = [(name, len(own), sum(own)) for name, own in by_name.items()]
    alarms = sum(alarm for _, alarm, _ in tallies)
    columns = ("hand", "recordings:d", "alarms:d")
    meaning = f"{100 * alarms / len(tallies):.2f} % of the recordings of hands without a fault are suspected."
    return TextTable("False alarms", columns, [*rows, ("all", len(tallies), alarms)], meaning)
