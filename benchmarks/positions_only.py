"""Hands measured by points without orientation, and by six receivers with what a study can declare."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks import other_hands
from benchmarks.accuracy.score import COVERED_95_SD
from benchmarks.benchmark_table import Cell, TextTable, add_people, of_each_person
from benchmarks.faultless_hands import FACINGS
from benchmarks.two_drawings import OTHER, OWN
from shukotsu.schemas.layout import Layout, read_layout
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
from shukotsu.stages.simulate.random_hand import BONES, JOINTS
from shukotsu.stages.simulate.random_hand import DIGITS as OWN_DIGITS
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate

WRITTEN_TO = "layouts.md", "points"
FIRST_SEED, DURATION_S, EVERY, POSED_FRAMES = 9700, 25.0, 4, 60
BIAS_MM, FAR_BIAS_MM, SLOW_FRAMES = 1.5, 3.0, 20
"""Of a keypoint about what it stands for, each way, all along: of the wrist and the thumb's CMC joint, and of
all others; and over how many frames half of the variance of its noise lasts. The fit knows none of them."""

CALLIPER_MM, TOUCH_MM = 0.5, 0.4
CONTACT_TASK = "opposition"


@dataclass(frozen=True)
class Drawn:
    """A person's recordings and what is true of them.

    poses : of the receivers by task, point_mm : by task the joints' centres and the digits' tips
    (`index_tip`), each (T, 3); lengths_mm : by bone.
    """

    hand: str
    poses: dict[str, Poses]
    point_mm: dict[str, dict[str, Array]]
    lengths_mm: dict[str, float]


@dataclass(frozen=True)
class Errors:
    """One hand's: centres (N, 2), mm off and the sd stated; lengths (B, 2) the same."""

    centres: Array
    lengths: Array


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, 4, FIRST_SEED)


def run(n_hands: int = 4, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many hands of each drawing."""
    rows: list[tuple[Cell, ...]] = []
    for drawing in (OWN, OTHER):
        hands = of_each_person(partial(one_hand, drawing), n_hands, seed)
        rows += [(name, drawing, *_summary([hand[name] for hand in hands])) for name in hands[0]]
    columns = (
        "measured by", "drawing", "centres mm:.2f", "stated:.2f", "in 95 %:.0f",
        "lengths mm:.2f", "stated:.2f", "in 95 %:.0f",
    )  # fmt: skip
    yield TextTable(
        "positions only",
        columns,
        rows,
        "Root mean squares. Centres: of the digits' joints beyond the palm, frame by frame in the transmitter's "
        "frame; their stated sd in 3-D; how often the true one is within 95 %. Lengths: of all bones but the "
        f"last. Points at joints are off by {BIAS_MM:g} mm each way all along, the wrist's and the thumb's CMC's "
        f"by {FAR_BIAS_MM:g}, and by noise of that sd each way, half of it slow.",
    )


def _summary(hands: Sequence[Errors]) -> Iterator[float]:
    for name, limit in (("centres", RADIUS_SD), ("lengths", COVERED_95_SD)):
        off, sd = np.concatenate([getattr(hand, name) for hand in hands]).T
        yield from np.sqrt([(off**2).mean(), (sd**2).mean()]).tolist()
        yield 100 * float(np.mean(np.abs(off) <= limit * sd))


def one_hand(drawing: str, seed: int) -> dict[str, Errors]:
    """Give the errors of a hand that is drawn, by what it was measured with."""
    drawn = DRAWINGS[drawing](seed, ("right", "left")[seed % 2])
    return {name: errors_of(drawn, *measured(drawn, seed)) for name, measured in WAYS.items()}


def _keypoints(noise_mm: float, drawn: Drawn, seed: int) -> tuple[Fingertips, Poses]:
    layout = read_layout("keypoints-21")
    poses = keypoints(drawn, layout, noise_mm, np.random.default_rng([seed, 7]))
    return fingertips(fit_hand([poses], layout, drawn.hand)), poses


def keypoints(drawn: Drawn, layout: Layout, noise_mm: float, rng: np.random.Generator) -> Poses:
    """Give what detectors would see of a range of motion: each point off, in its bone's frame, and noisy."""
    worn, places = drawn.poses["rom"], []
    for point in layout.points.values():
        digit = point.segment.partition("_")[0]
        true_mm = drawn.point_mm["rom"][f"{digit}_tip" if point.at == "tip" else point.at]
        bias_mm = rng.normal(0, FAR_BIAS_MM if point.at in ("wrist", "thumb_cmc") else BIAS_MM, 3)
        white, slow = rng.normal(0, noise_mm, (2, len(true_mm) + SLOW_FRAMES, 3)) * 0.5**0.5
        slow = np.cumsum(slow, 0)
        slow = (slow[SLOW_FRAMES:] - slow[:-SLOW_FRAMES]) / SLOW_FRAMES**0.5
        turn = worn.quaternion[:, worn.index(point.segment)]
        places.append(true_mm + rotate(turn, bias_mm) + white[SLOW_FRAMES:] + slow)
    return _points(worn, layout, dict(zip(layout.points, places, strict=True)))


def _points(worn: Poses, layout: Layout, places: dict[str, Array]) -> Poses:
    """Poses of a layout: points where they are, every receiver that it wants, thinned."""
    names = layout.expected
    numbers = []
    for name in names:
        if name in places:
            numbers.append((places[name], np.full((len(worn.frame), 4), np.nan)))
        else:
            at = worn.index(name)
            numbers.append((worn.position_mm[:, at], worn.quaternion[:, at]))
    position, quaternion = (np.stack(part, 1) for part in zip(*numbers, strict=True))
    valid = np.isfinite(position).all(-1)
    return Poses(names, worn.frame, worn.time_s, position, quaternion, valid).take(slice(None, None, EVERY))


def _tips_and_back(drawn: Drawn, _: int) -> tuple[Fingertips, Poses]:
    layout, worn = read_layout("tips-and-back"), drawn.poses["rom"]
    nails = {name: worn.position_mm[:, worn.index(own.segment)] for name, own in layout.points.items()}
    poses = _points(worn, layout, nails)
    return fingertips(fit_hand([poses], layout, drawn.hand)), poses


def _receivers(
    name: str, drawn: Drawn, seed: int, *, lengths: bool = False, touches: bool = False
) -> tuple[Fingertips, Poses]:
    layout, rng = read_layout(name), np.random.default_rng([seed, 8])
    poses = {task: _points(own, layout, {}) for task, own in drawn.poses.items()}
    measurements = [
        Measurement(bone, float(rng.normal(length_mm, CALLIPER_MM)), CALLIPER_MM)
        for bone, length_mm in drawn.lengths_mm.items()
        if lengths and not bone.endswith(("_distal", "_metacarpal"))
    ]
    tips = fingertips(fit_hand(list(poses.values()), layout, drawn.hand, measurements=measurements))
    if touches:
        frames = {task: int(rng.integers(len(own.frame))) for task, own in poses.items()}
        own = [
            touch_in(
                tips,
                poses[task],
                np.array([row]),
                digit,
                drawn.point_mm[task][f"{digit}_tip"][row * EVERY] + rng.normal(0, TOUCH_MM, 3),
            )
            for task, row in frames.items()
            for digit in tips.digits
            if poses[task].valid[row, poses[task].index(f"{digit}_distal")]
        ]
        tips = with_touches(with_touches(tips, own), find_contacts(tips, poses[CONTACT_TASK]))
    return tips, poses["rom"]


WAYS: dict[str, Callable[[Drawn, int], tuple[Fingertips, Poses]]] = {
    "keypoints-21, 1 mm": partial(_keypoints, 1.0),
    "keypoints-21, 5 mm": partial(_keypoints, 5.0),
    "tips-and-back": _tips_and_back,
    "tips-and-hand": partial(_receivers, "tips-and-hand"),
    "and calliper lengths": partial(_receivers, "tips-and-hand", lengths=True),
    "and touches": partial(_receivers, "tips-and-hand", lengths=True, touches=True),
}


def errors_of(drawn: Drawn, tips: Fingertips, poses: Poses) -> Errors:
    """Hold a fitted hand, posed in its calibration, against the truth."""
    rows = np.linspace(0, len(poses.frame) - 1, POSED_FRAMES).astype(int)
    posed = pose_hand(tips.fit, poses.take(rows))
    frames = tips.fit.evidence.convention.frames(poses.take(rows))
    stated = posed_errors(tips, posed, frames)
    joints = {joint.child: joint.name for joint in tips.fit.evidence.layout.joints.values()}
    centres = []
    for at, segment in enumerate(posed.bones):
        if (segment != "hand" and not joints[segment].endswith("_cmc")) or segment == "thumb_metacarpal":
            true_mm = drawn.point_mm["rom"][joints[segment]][rows * EVERY]
            off_mm = np.linalg.norm(posed.bone_position_mm[:, at] - true_mm, axis=1)
            centres.append(np.stack([off_mm, stated.centre_mm[:, at]], 1)[posed.posed])
    bones = [name for name in tips.fit.bones if not name.endswith("_distal")]
    lengths = [
        (tips.fit.bones[name].length_mm - drawn.lengths_mm[name], tips.fit.bones[name].sd_mm)
        for name in bones
    ]
    return Errors(np.concatenate(centres), np.array(lengths))


def _own(seed: int, hand: str) -> Drawn:
    poses, points, lengths = {}, {}, {}
    for task in ("rom", "opposition"):
        made = simulate("01", hand, task, seed, Realism(), round(240 * DURATION_S))
        truth, poses[task] = made.truth, made.poses()
        points[task] = {name: truth.bone_position_mm[:, JOINTS.index(name) + 1] for name in JOINTS[1:]}
        points[task]["wrist"] = truth.bone_position_mm[:, BONES.index("hand")]
        points[task] |= {f"{name}_tip": truth.skin_tip_mm[:, i] for i, name in enumerate(OWN_DIGITS)}
        lengths = {bone: float(truth.hand.length_mm[BONES.index(bone)]) for bone in BONES if "_" in bone}
    return Drawn(hand, poses, points, lengths)


def _other(seed: int, hand: str) -> Drawn:
    person = other_hands.draw_person(seed, thumb_facing=FACINGS[seed % len(FACINGS)])
    poses, points, lengths = {}, {}, {}
    for task, movement in (("rom", "calibration"), ("opposition", "opposition")):
        made = other_hands.record(person, hand, movement, seed=seed, duration_s=DURATION_S, forearm=True)
        poses[task], lengths = made.poses, made.true_lengths_mm
        tips = {f"{digit}_tip": own for digit, own in made.true_tip_mm.items()}
        points[task] = {**made.true_centre_mm, **tips}
    return Drawn(hand, poses, points, lengths)


DRAWINGS = {OWN: _own, OTHER: _other}
