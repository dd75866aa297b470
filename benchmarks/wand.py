"""Rooms mapped by a wand: whether the map is true, and joint centres within 95 % without and with it."""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks import other_hands
from benchmarks.benchmark_table import TextTable, add_people, of_each_person
from benchmarks.faultless_hands import true_halves
from benchmarks.other_hands.room import draw_field
from shukotsu.checks.rigid_bar import Bar, usable_bar
from shukotsu.checks.room_map import room_map
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.field_test import Field
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.mapped_room import MappedRoom, widened
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import LAYOUT, simulate
from shukotsu.stages.simulate.tracker_errors import distorted, noisy

FIRST_SEED, BAR_MM, N_FRAMES, RATE_HZ, HAND = 9700, 100.0, 14_400, 240.0, "right"
STEEL_MM, STEEL = 100.0, np.array([1.5, 1.0, 1.0, *np.radians([0.8, 1.2, 0.6])])
ROOMS = tuple(product(("own", "other", "steel"), (1.0, 4.0, 8.0)))
_AHEAD = np.array([1.0, 0.0, 0.0])
_ROOM_HEADS = ("r mm:.2f", "r deg:.2f", "mm:.2f", "deg:.2f", "true mm:.2f", "true deg:.2f", "outside %:.0f")
_HAND_HEADS = ("off mm:.2f", "sd:.2f", "with map:.2f", "in 95 %:.1f", "with map :.1f")
_MEANING = """field: times a laboratory's, or that of steel 100 mm beside the hand. r: correlation of map and
truth over cells; then rms of both. outside: poses where the map does not trust. Then joint centres, each the
worse half: how far off, stated sd, share within its 95 %."""

Room = Callable[[Array, Array], tuple[Array, Array]]
"""What a tracker without noise says of places (T, S, 3), mm, and quaternions (T, S, 4)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    add_people(parser, 12, FIRST_SEED)


def run(n_hands: int = 12, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many hands, each in a room of its own."""
    rows = []
    for drawing, times in ROOMS:
        rooms, joints = zip(*of_each_person(partial(one_room, drawing, times), n_hands, seed), strict=True)
        rows.append((drawing, times, *np.mean(rooms, 0).tolist(), *np.concatenate(joints).mean(0).tolist()))
    yield TextTable("Wands", ("drawing", "field:.0f", *_ROOM_HEADS, *_HAND_HEADS), rows, _MEANING)


def one_room(drawing: str, times: float, seed: int) -> tuple[Array, Array]:
    """Give numbers (7,) of a room's map, and (J, 5) of a hand's joints in it."""
    rng = np.random.default_rng([seed, 5])
    poses, truth, room = (own_room if drawing == "own" else other_room)(drawing, times, seed, rng)
    places = poses.position_mm[poses.valid]
    bar, found, _ = usable_bar(recorded_bar(room, np.percentile(places, [1, 99], axis=0), rng))
    cells, fit = room_map(bar, found), fit_hand([poses], read_layout(LAYOUT), HAND)
    known, error = cells.known, cells.error[:, cells.known]
    mapped = MappedRoom(
        cells.centres_mm[known], error.T, cells.trusted[known].astype(float), cells.cell_mm, BAR_MM
    )
    wider, rows = widened(fit, mapped)[0], []
    for name in sorted(fit.joints.keys() & truth.keys()):
        one, sd_mm = fit.joints[name], np.array([fit.joints[name].sd_mm, wider.joints[name].sd_mm])
        off_mm = np.linalg.norm([one.parent_mm, one.child_mm] - truth[name], axis=1).max()
        rows.append([off_mm, *sd_mm, *100.0 * (off_mm <= RADIUS_SD * sd_mm)])
    ends = mapped.centres_mm[:, None, None] + np.zeros((40, 2, 3))  # bars in all directions from each cell
    ends[:, :, 1] += BAR_MM * Rotation.random(40, random_state=seed).apply(_AHEAD)
    place, turn = room(ends, np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*ends.shape[:3], 4)))
    off = (place - ends, _rotation(turn).as_rotvec(degrees=True).reshape(ends.shape))
    true = np.sqrt([(np.diff(own, axis=2) ** 2).sum((2, 3)).mean(1) / 2 for own in off])
    r = [np.corrcoef(own, one)[0, 1] for own, one in zip(error, true, strict=True)]
    rms = np.sqrt((np.concatenate([error, true]) ** 2).mean(1))
    return np.array([*r, *rms, 100.0 * (1.0 - mapped.at(places)[:, 2].mean())]), np.array(rows)


def own_room(_: str, times: float, seed: int, __: object) -> tuple[Poses, dict[str, Array], Room]:
    """Give a hand of the project's drawing as measured, its true centres by joint, and the room."""
    made = simulate("01", HAND, "rom", seed, Realism(field_distortion=times), 6000)
    truth = {name: np.array([one.parent_mm, one.child_mm]) for name, one in made.truth.joints.items()}
    return made.poses(), truth, partial(distorted, seed=seed, scale=times)


def other_room(
    drawing: str, times: float, seed: int, rng: np.random.Generator
) -> tuple[Poses, dict[str, Array], Room]:
    """Give the same of the other drawing, in its own rooms or beside steel."""
    made = other_hands.record(other_hands.draw_person(seed), HAND, "calibration", seed=seed)
    true, outward = made.true_pose, Rotation.random(random_state=seed).apply(_AHEAD)
    nearest = max(true.position_mm.reshape(-1, 3), key=lambda own: float(own @ outward))
    steel = Field(nearest + STEEL_MM * outward, nearest, STEEL)
    field = draw_field(np.random.default_rng([seed, 33]))

    def room(place: Array, turn: Array) -> tuple[Array, Array]:
        off = times * field.at(place) if drawing == "other" else field.at(place) + times * steel.at(place)
        seen = Rotation.from_rotvec(off[..., 3:].reshape(-1, 3)) * _rotation(turn)
        return place + off[..., :3], seen.as_quat(scalar_first=True).reshape(turn.shape)

    position_mm, quaternion = noisy(*room(true.position_mm, true.quaternion), 1.0, rng)
    poses = Poses(true.segments, true.frame, true.time_s, position_mm, quaternion, true.valid)
    return poses, true_halves(made), room


def recorded_bar(room: Room, box_mm: Array, rng: np.random.Generator) -> Bar:
    """Record a bar that is swept through a box (2, 3), and a little beyond, and turned, for a minute."""
    time_s, hz = np.arange(N_FRAMES) / RATE_HZ, rng.uniform([0.31, 0.17, 0.05] * 2, [0.41, 0.23, 0.08] * 2)
    waves = np.arcsin(np.sin(2 * np.pi * (time_s[:, None] * hz + rng.random(6)))) * 2 / np.pi
    turn = Rotation.from_euler("zyx", waves[:, 3:] * [1.5, 1.5, 2.5])
    middle = box_mm.mean(0) + (np.ptp(box_mm, axis=0) / 2 + 60.0) * waves[:, :3]
    ends = np.stack([middle + end * turn.apply(_AHEAD) for end in (-BAR_MM / 2, BAR_MM / 2)], 1)
    mounts = [turn * Rotation.from_euler("zyx", rng.uniform(-0.5, 0.5, 3)) for _ in range(2)]
    turns = np.stack([own.as_quat(scalar_first=True) for own in mounts], 1)
    return Bar(("1", "2"), time_s, *noisy(*room(ends, turns), 1.0, rng))


def _rotation(quaternion: Array) -> Rotation:
    return Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
