"""Hands measured by points without orientation, and by six receivers with what a study can declare."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks import other_hands
from benchmarks.accuracy.score import COVERED_95_SD
from benchmarks.benchmark_table import Cell, TextTable, add_people, of_each_person
from benchmarks.faultless_hands import FACINGS
from benchmarks.two_drawings import OTHER, OWN
from shukotsu.schemas.layout import SKIN, TIP, Layout, Point, read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.skeleton.rotations import Array, rotate
from shukotsu.stages.fit_hand.contacts import find_contacts
from shukotsu.stages.fit_hand.fingertips import Fingertips, fingertips
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.fitted_motion import pose_hand
from shukotsu.stages.fit_hand.frame_uncertainty import posed_errors
from shukotsu.stages.fit_hand.measurements import Measurement
from shukotsu.stages.fit_hand.touches import touch_in, with_touches
from shukotsu.stages.simulate.random_hand import BONES, DIGITS, JOINTS
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate

FIRST_SEED, DURATION_S, EVERY, POSED_FRAMES = 9700, 25.0, 4, 60
TASKS = {"rom": "calibration", "opposition": "opposition"}
"""By their names in either drawing."""

BIAS_MM, FAR_BIAS_MM, SLOW_FRAMES = 1.5, 3.0, 20
"""Each way, of a keypoint all along, and of the wrist's and the thumb's CMC's; half of its noise lasts so."""

CALLIPER_MM, TOUCH_MM = 0.5, 0.4


@dataclass(frozen=True)
class Way:
    """A layout, the keypoints' noise, and whether lengths and touches are declared."""

    layout: str
    noise_mm: float = 0.0
    lengths: bool = False
    touches: bool = False


WAYS = {
    "keypoints-21, 1 mm": Way("keypoints-21", 1.0),
    "keypoints-21, 5 mm": Way("keypoints-21", 5.0),
    "tips-and-back": Way("tips-and-back"),
    "tips-and-hand": Way("tips-and-hand"),
    "and calliper lengths": Way("tips-and-hand", lengths=True),
    "and touches": Way("tips-and-hand", lengths=True, touches=True),
}


@dataclass(frozen=True)
class Drawn:
    """A person's recordings by task; what is true: joints' centres and tips (T, 3) by task, and lengths."""

    hand: str
    poses: dict[str, Poses]
    point_mm: dict[str, dict[str, Array]]
    lengths_mm: dict[str, float]


Errors = tuple[Array, Array]
"""Of centres (N, 2) and lengths (B, 2): mm off and the sd stated."""


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, 4, FIRST_SEED)


def run(n_hands: int = 4, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many hands of each drawing."""
    rows: list[tuple[Cell, ...]] = []
    for drawing in DRAWINGS:
        hands = of_each_person(partial(one_hand, drawing), n_hands, seed)
        rows += [(name, drawing, *_summary([hand[name] for hand in hands])) for name in WAYS]
    kinds = [f"{kind} mm:.2f,stated:.2f,in 95 %:.0f" for kind in ("centres", "lengths")]
    yield TextTable(
        "positions only",
        ["measured by", "drawing", *",".join(kinds).split(",")],
        rows,
        "Root mean squares. Centres: of the digits' joints beyond the palm, frame by frame in the "
        "transmitter's frame; their stated sd in 3-D; how often the true one is within 95 %. Lengths: of all "
        "bones but the last.",
    )


def _summary(hands: list[Errors]) -> Iterator[float]:
    for own, limit in zip(zip(*hands, strict=True), (RADIUS_SD, COVERED_95_SD), strict=True):
        off, sd = np.concatenate(own).T
        yield from np.sqrt([(off**2).mean(), (sd**2).mean()]).tolist()
        yield 100 * float(np.mean(np.abs(off) <= limit * sd))


def one_hand(drawing: str, seed: int) -> dict[str, Errors]:
    """Give the errors of a hand that is drawn, by what it was measured with."""
    drawn = DRAWINGS[drawing](seed, ("right", "left")[seed % 2])
    return {name: measured(drawn, way, np.random.default_rng([seed, 7])) for name, way in WAYS.items()}


def measured(drawn: Drawn, way: Way, rng: np.random.Generator) -> Errors:
    """Give the errors of a hand that is measured in one way."""
    layout = read_layout(way.layout)
    poses = {task: recorded(drawn, task, layout, way.noise_mm, rng) for task in TASKS}
    if not way.touches:
        del poses["opposition"]
    bones = [b for b in drawn.lengths_mm if not b.endswith(("_distal", "_metacarpal")) and way.lengths]
    lengths = [
        Measurement(bone, float(rng.normal(drawn.lengths_mm[bone], CALLIPER_MM)), CALLIPER_MM)
        for bone in bones
    ]
    tips = fingertips(fit_hand(list(poses.values()), layout, drawn.hand, measurements=lengths))
    if way.touches:
        tips = _touched(tips, drawn, poses, rng)
    return errors_of(drawn, tips, poses["rom"])


def recorded(drawn: Drawn, task: str, layout: Layout, noise_mm: float, rng: np.random.Generator) -> Poses:
    """Give a task as the layout's receivers and points have it, thinned."""
    worn, numbers = drawn.poses[task], []
    for name in layout.expected:
        point = layout.points.get(name)
        at = worn.index(name if point is None else point.segment)
        position, turn = worn.position_mm[:, at], worn.quaternion[:, at]
        if point is not None and point.at != SKIN:
            position = _keypoint(drawn.point_mm[task], point, turn, noise_mm, rng)
        numbers.append((position, turn if point is None else np.full_like(turn, np.nan)))
    places, turns = (np.stack(part, 1) for part in zip(*numbers, strict=True))
    valid = np.isfinite(places).all(-1)
    whole = Poses(layout.expected, worn.frame, worn.time_s, places, turns, valid)
    return whole.take(slice(None, None, EVERY))


def _keypoint(
    true_mm: dict[str, Array], point: Point, turn: Array, noise_mm: float, rng: np.random.Generator
) -> Array:
    """A joint or a tip as a detector sees it: off in its bone's frame, and noisy."""
    place = true_mm[f"{point.segment.partition('_')[0]}_tip" if point.at == TIP else point.at]
    bias_mm = rng.normal(0, FAR_BIAS_MM if point.at in ("wrist", "thumb_cmc") else BIAS_MM, 3)
    white, steps = rng.normal(0, noise_mm * 0.5**0.5, (2, len(place) + SLOW_FRAMES, 3))
    walk = np.cumsum(steps, 0)
    slow = (walk[SLOW_FRAMES:] - walk[:-SLOW_FRAMES]) / SLOW_FRAMES**0.5
    return np.asarray(place + rotate(turn, bias_mm) + white[SLOW_FRAMES:] + slow)


def _touched(tips: Fingertips, drawn: Drawn, poses: dict[str, Poses], rng: np.random.Generator) -> Fingertips:
    """The hand after each tip touched a known point once a task, and pads met in opposition."""
    touches = []
    for task, own in poses.items():
        for digit, tip in tips.digits.items():
            row = int(rng.choice(np.flatnonzero(own.valid[:, own.index(tip.receiver)])))
            point_mm = drawn.point_mm[task][f"{digit}_tip"][row * EVERY] + rng.normal(0, TOUCH_MM, 3)
            touches.append(touch_in(tips, own, np.array([row]), digit, point_mm))
    tips = with_touches(tips, touches)
    return with_touches(tips, find_contacts(tips, poses["opposition"]))


def errors_of(drawn: Drawn, tips: Fingertips, poses: Poses) -> Errors:
    """Hold a fitted hand, posed in its calibration, against the truth."""
    rows = np.linspace(0, len(poses.frame) - 1, POSED_FRAMES).astype(int)
    few, fit = poses.take(rows), tips.fit
    posed = pose_hand(fit, few)
    stated_mm = posed_errors(tips, posed, fit.evidence.convention.frames(few)).centre_mm
    centres = []
    for joint in fit.evidence.layout.joints.values():
        if joint.child in fit.bones and (joint.parent == "hand") == (joint.name == "thumb_cmc"):
            at = posed.bones.index(joint.child)
            off_mm = posed.bone_position_mm[:, at] - drawn.point_mm["rom"][joint.name][rows * EVERY]
            own = np.stack([np.linalg.norm(off_mm, axis=1), stated_mm[:, at]], 1)
            centres.append(own[posed.posed])
    bones = {name: own for name, own in fit.bones.items() if not name.endswith("_distal")}
    lengths = [(own.length_mm - drawn.lengths_mm[name], own.sd_mm) for name, own in bones.items()]
    return np.concatenate(centres), np.array(lengths)


def _own(seed: int, hand: str) -> Drawn:
    made = {task: simulate("01", hand, task, seed, Realism(), round(240 * DURATION_S)) for task in TASKS}
    lengths_mm = made["rom"].truth.hand.length_mm
    points = {
        task: {joint: own.truth.bone_position_mm[:, JOINTS.index(joint) + 1] for joint in JOINTS}
        | {"wrist": own.truth.bone_position_mm[:, BONES.index("hand")]}
        | {f"{digit}_tip": own.truth.skin_tip_mm[:, i] for i, digit in enumerate(DIGITS)}
        for task, own in made.items()
    }
    poses = {task: own.poses() for task, own in made.items()}
    return Drawn(hand, poses, points, {b: float(lengths_mm[i]) for i, b in enumerate(BONES) if "_" in b})


def _other(seed: int, hand: str) -> Drawn:
    person = other_hands.draw_person(seed, thumb_facing=FACINGS[seed % len(FACINGS)])
    made = {
        task: other_hands.record(person, hand, name, seed=seed, duration_s=DURATION_S, forearm=True)
        for task, name in TASKS.items()
    }
    points = {
        task: own.true_centre_mm | {f"{digit}_tip": tip for digit, tip in own.true_tip_mm.items()}
        for task, own in made.items()
    }
    poses = {task: own.poses for task, own in made.items()}
    return Drawn(hand, poses, points, made["rom"].true_lengths_mm)


DRAWINGS = {OWN: _own, OTHER: _other}
