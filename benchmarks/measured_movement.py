"""Joint angles of whole hands of two drawings against their truth: ranges, medians and their stated sd."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks import other_hands
from benchmarks.benchmark_table import Cell, TextTable, add_people, of_each_person
from benchmarks.faultless_hands import FACINGS, THUMB, nail_turn
from benchmarks.other_hands.carriage import carry
from benchmarks.two_drawings import OTHER, OWN
from shukotsu.anatomy.average_hand import DIGITS
from shukotsu.anatomy.recorded_movement import ANGLES
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.angle_range import HIGH_PERCENT, LOW_PERCENT
from shukotsu.skeleton.joint_angles import joint_angles, mirrored
from shukotsu.skeleton.rotations import Array, about_axis, conjugate, from_matrix, matrix, multiply, unit
from shukotsu.stages.fit_hand.fingertips import fingertips
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.fit_hand.fitted_motion import joint_angles_of, pose_hand
from shukotsu.stages.fit_hand.frame_uncertainty import posed_errors
from shukotsu.stages.fit_hand.posed_tables import ERRORS_OF_ANGLES
from shukotsu.stages.measure_movement.angle_ranges import AngleErrors, angle_range
from shukotsu.stages.simulate.random_hand import BONES, FLEXION, JOINTS, PARENT
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import LAYOUT, Simulated, simulate

WRITTEN_TO = "movement.md", "measured"
FIRST_SEED = 9700
DURATION_S = {"rom": 25.0, "opposition": 16.0}
MOVEMENTS = {"rom": "calibration", "opposition": "opposition"}
X = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class Bones:
    """True bones of a right hand, or of a left one in the mirror, in the frame of the hand.

    quaternion : segment to (T, 4); flat : to (4,), as the digits lie straight in the flat hand; axis : joint
    to its axis of flexion there, (3,).
    """

    quaternion: Mapping[str, Array]
    flat: Mapping[str, Array]
    axis: Mapping[str, Array]


@dataclass(frozen=True)
class AngleError:
    """An angle of one hand in one recording: errors of range and median with the sd stated of each; slope :
    of the angle's error over the true flexion.
    """

    drawing: str
    task: str
    joint: str
    angle: str
    range_deg: float
    range_off_deg: float
    range_sd_deg: float
    median_off_deg: float
    median_sd_deg: float
    slope: float


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, 12, FIRST_SEED)


def run(n_hands: int = 12, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the table over that many hands of each drawing."""
    found = [
        one
        for drawing in (OWN, OTHER)
        for hand in of_each_person(partial(one_hand, drawing), n_hands, seed)
        for one in hand
    ]
    columns = (
        "angle", "joints", "drawing", "range:.1f", "off:.2f", "sd:.2f", "held %:.0f",
        "median off:.2f", "sd:.2f", "held %:.0f", "slope:+.3f", "its sd:.3f",
    )  # fmt: skip
    meaning = (
        f"Degrees, {n_hands} whole hands of each drawing, calibrated on a range of motion and measured in it "
        "and in opposition. Range: median of the true ones; off, sd: root mean square of errors and of what "
        "is stated; held: within 1.96 stated. Slope: of the error over true flexion, mean and sd over hands. "
        "Own: this project's simulator; other: a drawing that shares nothing with it."
    )
    yield TextTable("movement of two drawings", columns, list(_rows(found)), meaning)


def _rows(found: Sequence[AngleError]) -> Iterator[tuple[Cell, ...]]:
    for angle in ANGLES:
        for kind in ("all", *dict.fromkeys(_kind(one.joint) for one in found)):
            for drawing in (OWN, OTHER):
                alike = [one for one in found if (one.angle, one.drawing) == (angle, drawing)]
                alike = [one for one in alike if kind in ("all", _kind(one.joint))]
                numbers = np.array(
                    [
                        (one.range_off_deg, one.range_sd_deg, one.median_off_deg, one.median_sd_deg)
                        for one in alike
                    ]
                )
                rms, (off, sd, middle, middle_sd) = np.sqrt((numbers**2).mean(0)).tolist(), np.abs(numbers.T)
                held = [100 * float(np.mean(a < 1.96 * b)) for a, b in ((off, sd), (middle, middle_sd))]
                slopes = np.array([one.slope for one in alike])
                ranges = float(np.median([one.range_deg for one in alike]))
                own = (*rms[:2], held[0], *rms[2:], held[1], float(slopes.mean()), float(slopes.std()))
                yield angle, kind, drawing, ranges, *own


def _kind(joint: str) -> str:
    digit, _, kind = joint.partition("_")
    return f"thumb {kind.upper()}" if digit == "thumb" else kind.upper()


def one_hand(drawing: str, seed: int) -> list[AngleError]:
    """Give the errors of a hand that is drawn, calibrated on a range of motion and measured."""
    hand, layout = ("right", "left")[seed % 2], read_layout(LAYOUT)
    drawn = {task: DRAWINGS[drawing](seed, hand, task) for task in DURATION_S}
    tips = fingertips(fit_hand([drawn["rom"][0]], layout, hand))
    found = []
    for task, (poses, bones) in drawn.items():
        posed = pose_hand(tips.fit, poses)
        errors = posed_errors(tips, posed, tips.fit.evidence.convention.frames(poses))
        for joint, angles in joint_angles_of(tips.fit, posed).items():
            own = tips.fit.summary.angle_axes[joint]
            true = true_angles_deg(bones, joint, own.parent, own.child)
            for index, angle in enumerate(ANGLES):
                sds = (getattr(errors, name)[joint][:, index] for name in ERRORS_OF_ANGLES.values())
                row = angle_range(angles[:, index], AngleErrors(*sds))
                low, middle, high = np.percentile(true[:, index], [LOW_PERCENT, 50.0, HIGH_PERCENT])
                range_deg, off_deg = float(high - low), float(row["median_deg"] - middle)
                off = row["range_deg"] - range_deg, row["range_sd_deg"], off_deg, row["median_sd_deg"]
                slope = float(np.polyfit(true[:, 0], angles[:, index] - true[:, index], 1)[0])
                found.append(AngleError(drawing, task, joint, angle, range_deg, *off, slope))
    return found


def true_angles_deg(bones: Bones, joint: str, parent: str, child: str) -> Array:
    """Angles (T, 3) from the documented zero, about the joint's true axis.

    How a bone faces is nothing but a convention: zero of rotation is the flat hand. Of a CMC joint all of it
    is; beyond, the digit is straight as the average hand's is.
    """
    rest = multiply(conjugate(bones.flat[parent]), bones.flat[child])
    digit, _, kind = joint.partition("_")
    if kind != "cmc":
        frames = replace(DIGITS[digit], faces_nail=digit == "thumb").frames()
        index = [name.partition("_")[2] for name in JOINTS if name.startswith(f"{digit}_")].index(kind)
        rest = from_matrix(frames[index - 1].T @ frames[index])
        rotation_deg = joint_angles(bones.flat[parent], bones.flat[child], "right", rest)[2]
        rest = multiply(rest, about_axis(X, np.array(-np.radians(rotation_deg))))
    axis = bones.axis["thumb_mcp" if joint == "thumb_cmc" else joint]
    _, y, z = matrix(bones.flat[child]).T @ axis
    axes = about_axis(X, np.arctan2(z, y))
    return joint_angles(bones.quaternion[parent], bones.quaternion[child], "right", rest, axes)


def all_true_angles_deg(bones: Bones) -> dict[str, Array]:
    """The same of every joint of the digits."""
    return {
        joint: true_angles_deg(bones, joint, BONES[PARENT[index]], BONES[index + 1])
        for index, joint in enumerate(JOINTS[1:], 1)
    }


def _own(seed: int, hand: str, task: str) -> tuple[Poses, Bones]:
    made = simulate("01", hand, task, seed, Realism(), round(240 * DURATION_S[task]))
    return made.poses(), own_bones(made)


def own_bones(made: Simulated) -> Bones:
    """The thumb's metacarpal faces its nail; a left hand's frames and axes (pseudo-vectors) are mirrored."""
    truth, flat = made.truth, {"hand": np.array([1.0, 0.0, 0.0, 0.0])}
    axis: dict[str, Array] = {}
    for index, joint in enumerate(JOINTS[1:], 1):
        parent = flat[BONES[PARENT[index]]]
        axis[joint] = matrix(parent) @ truth.hand.axes[index, FLEXION]
        flat[BONES[index + 1]] = multiply(parent, truth.hand.rest[index])
    back = conjugate(truth.bone_quaternion[:, BONES.index("hand")])
    bones = {bone: multiply(back, truth.bone_quaternion[:, BONES.index(bone)]) for bone in flat}
    for own in (flat, bones):
        own[THUMB] = multiply(own[THUMB], nail_turn(made))
    if made.hand == "left":
        flat, bones = ({bone: mirrored(turn) for bone, turn in own.items()} for own in (flat, bones))
        axis = {joint: own * np.array([-1.0, 1.0, -1.0]) for joint, own in axis.items()}
    return Bones(bones, flat, axis)


def _other(seed: int, hand: str, task: str) -> tuple[Poses, Bones]:
    person = other_hands.draw_person(seed, thumb_facing=FACINGS[seed % len(FACINGS)])
    made = other_hands.record(person, hand, MOVEMENTS[task], seed=seed, duration_s=DURATION_S[task])
    return made.poses, other_bones(person, made.true_angles_deg)


def other_bones(person: other_hands.Person, angles_deg: dict[str, Array]) -> Bones:
    """Bones as they lie on the table, and as they are carried; x of the hand's frame points to the north."""
    to_hand = Rotation.from_euler("z", -90, degrees=True).as_matrix()
    motions, _ = carry(person, angles_deg)
    turns = {name: to_hand @ motions[name][0] for name in person.bones if name != "forearm"}
    flat = {"hand": np.eye(3)}
    for name in turns.keys() - {"hand"}:
        x, up = person.bones[name].along, person.bones[name].up
        z = unit(up - (up @ x) * x)
        flat[name] = to_hand @ np.stack([x, np.cross(z, x), z], -1)
    back = np.swapaxes(turns["hand"] @ to_hand.T, -1, -2)
    bones = {name: from_matrix(back @ turns[name] @ to_hand.T @ flat[name]) for name in flat}
    axis = {joint.name: to_hand @ unit(joint.turns[0][1][:, 0]) for joint in person.joints}
    return Bones(bones, {name: from_matrix(turn) for name, turn in flat.items()}, axis)


DRAWINGS = {OWN: _own, OTHER: _other}
