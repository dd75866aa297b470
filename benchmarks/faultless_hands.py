"""Recordings without a mistake, of usual and unusual hands, from our simulator and an independent one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.other_hands.person import Facing, draw_person
from benchmarks.other_hands.recording import DrawnRecording, Session, record
from shukotsu.checks.checked_recording import check_recording
from shukotsu.checks.hypotheses import TIDY, Declared
from shukotsu.hand.rotations import Array, about_axis, conjugate, multiply, rotate
from shukotsu.simulate import random_hand
from shukotsu.simulate.random_hand import FINGERS, FLEXION, JOINTS, RandomHand
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import LAYOUT, Simulated, simulate
from shukotsu.simulate.task_motion import TaskMotion
from shukotsu.study.findings import NOTE, Finding
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses, RecordingName

FRAMES = {"rom": 1800, "opposition": 1200}
THUMB = "thumb_metacarpal"


@dataclass(frozen=True)
class Planted:
    """A recording with or without a mistake: its poses, the declared hand, and what its mapping declares."""

    poses: Poses
    hand: str
    declared: Declared = TIDY

    def findings(self) -> list[Finding]:
        """Return the findings without notes, except notes on receivers that are stuck."""
        findings = check_recording(self.poses, read_layout(LAYOUT), self.hand, self.declared).findings
        return [each for each in findings if each.severity != NOTE or each.kind == "receiver-stuck"]


def faultless(seed: int, hand: str, rng: np.random.Generator) -> Iterator[tuple[str, str, Planted]]:
    """Yield the simulator, the peculiarity and the recording of hands without a mistake."""
    for task in FRAMES:
        for name, recording in _own_odd(seed, hand, task, rng):
            yield "own", f"{name}, {task}", recording
    for name, other in _other_odd(seed, hand, rng):
        yield "other", name, other


def own_hand(
    seed: int, hand: str, task: str, *, artefact: float = 1.0, at_nail: bool = False, **simulated: Any
) -> Planted:
    """Record a hand of the project's simulator.

    task : rom or opposition. at_nail : whether the thumb metacarpal's receiver faces the nail's side.
    simulated : further arguments of `simulate`.
    """
    simulation = simulate(
        RecordingName("01", hand, task), seed, Realism(artefact=artefact), FRAMES[task], **simulated
    )
    return Planted(facing_the_nail(simulation) if at_nail else simulation, hand)


def other_hand(seed: int, hand: str, task: str, **recorded: Any) -> Planted:
    """Record an ordinary hand of the independent simulator.

    The direction in which the thumb metacarpal's receiver faces depends on the seed. task : rom, opposition,
    grip, typing or piano. recorded : fields of `other_hands.recording.Session`.
    """
    return Planted(other_recording(seed, hand, task, {}, **recorded).poses, hand)


FACINGS: tuple[Facing, ...] = ("nail", "between", "hand")


def other_recording(
    seed: int, hand: str, task: str, drawn: Mapping[str, Any], **recorded: Any
) -> DrawnRecording:
    """Record a hand of the independent simulator with its truth; drawn : arguments of `draw_person`."""
    person = draw_person(seed, **{"thumb_facing": FACINGS[seed % len(FACINGS)], **drawn})
    session = Session(**{"duration_s": 7.5, **recorded})
    return record(person, hand, "calibration" if task == "rom" else task, seed, session)


def _other_odd(seed: int, hand: str, rng: np.random.Generator) -> Iterator[tuple[str, Planted]]:
    people: dict[str, dict[str, Any]] = {
        "thumb's receiver on the nail's side": {"thumb_facing": "nail"},
        "thumb's receiver on the hand's side": {"thumb_facing": "hand"},
        "thumb's receiver between": {"thumb_facing": "between"},
        "thick skin": {"skin": "thick"},
        "thin skin": {"skin": "thin"},
        "a child": {"scale": 0.68},
        "a large hand": {"scale": 1.2},
    }
    for name, drawn in people.items():
        yield f"{name}, rom", Planted(other_recording(seed, hand, "rom", drawn).poses, hand)
        task = str(rng.choice(TASKS))
        yield f"{name}, a task", Planted(other_recording(seed, hand, task, drawn).poses, hand)
    yield "dropouts", other_hand(seed, hand, "rom", dropouts=True)
    yield "with a receiver on the forearm", other_hand(seed, hand, "rom", forearm=True)
    yield "stiff finger joints", other_hand(seed, hand, "rom", stiff=STIFF)
    yield "60 Hz", other_hand(seed, hand, "rom", rate_hz=60.0)


TASKS = ("grip", "typing", "piano", "opposition")
STIFF = tuple(f"{finger}_{joint}" for finger in FINGERS for joint in ("pip", "dip"))


def _own_odd(seed: int, hand: str, task: str, rng: np.random.Generator) -> Iterator[tuple[str, Planted]]:
    plain = own_hand(seed, hand, task)
    yield "usual hand", plain
    yield "thumb's receiver on the nail's side", own_hand(seed, hand, task, at_nail=True)
    for what, factor in (("small", 0.68), ("large", 1.22)):
        scaled_mm = plain.poses.position_mm * factor
        yield f"very {what} hand ({factor} times)", changed(plain, position_mm=scaled_mm)
    yield "loose receivers (skin 3 times)", own_hand(seed, hand, task, artefact=3.0)
    yield "dropouts, one receiver dead", _with_dropouts(plain, rng)
    yield "with a receiver on the forearm", own_hand(seed, hand, task, forearm=True)
    yield "stiff finger joints (a tenth)", _stiff(seed, hand, task, ("pip", "dip"))
    yield "stiff thumb and index (a tenth)", _stiff(seed, hand, task, ("thumb", "index"))
    yield "deformed (ulnar drift, a short bone)", _deform_fingers(seed, hand, task, rng)


def exchange_receivers(poses: Poses, *pairs: tuple[str, str]) -> Poses:
    """Return poses in which pairs of receivers are exchanged."""
    order = list(range(len(poses.segments)))
    for first, second in pairs:
        i, j = poses.index(first), poses.index(second)
        order[i], order[j] = j, i
    arrays = {name: getattr(poses, name)[:, order] for name in ("position_mm", "quaternion", "valid")}
    return replace(poses, **arrays)


def changed(planted: Planted, **arrays: Any) -> Planted:
    """Replace arrays of the recording's poses."""
    return replace(planted, poses=replace(planted.poses, **arrays))


def _with_dropouts(planted: Planted, rng: np.random.Generator) -> Planted:
    valid = planted.poses.valid.copy()
    for receiver in range(valid.shape[1]):
        for start in rng.integers(0, len(valid), 4):
            valid[start : start + rng.integers(5, 200), receiver] = False
    valid[:, rng.integers(1, valid.shape[1])] = False
    gone, poses = ~valid[..., None], planted.poses
    position = np.where(gone, np.nan, poses.position_mm)
    quaternion = np.where(gone, np.nan, poses.quaternion)
    return changed(planted, valid=valid, position_mm=position, quaternion=quaternion)


def _stiff(seed: int, hand: str, task: str, joints: Sequence[str]) -> Planted:
    """Record a hand in which these joints move a tenth of their usual range."""

    def change(motion: TaskMotion) -> TaskMotion:
        angles = motion.angles_rad.copy()
        for joint in (i for i, name in enumerate(JOINTS) if any(part in name for part in joints)):
            angles[:, joint] = angles[0, joint] + 0.1 * (angles[:, joint] - angles[0, joint])
        return replace(motion, angles_rad=angles)

    return own_hand(seed, hand, task, change=change)


def _deform_fingers(seed: int, hand: str, task: str, rng: np.random.Generator) -> Planted:
    """Record a hand whose fingers deviate to the ulna by 20 deg, with one bone a quarter shorter."""
    short = int(rng.integers(7, 21))

    def hand_of(*args: Any) -> RandomHand:
        usual = random_hand.hand_of(*args)
        length, rest = usual.length_mm.copy(), usual.rest.copy()
        length[short] *= 0.75
        drift = about_axis(np.array([0.0, 0.0, -1.0 if usual.side == "right" else 1.0]), np.radians(20.0))
        for joint in (JOINTS.index(f"{finger}_mcp") for finger in FINGERS):
            rest[joint] = multiply(rest[joint], drift)
        return replace(usual, length_mm=length, rest=rest)

    with mock.patch("shukotsu.simulate.simulation.hand_of", hand_of):
        return own_hand(seed, hand, task)


def nail_turn(simulated: Simulated) -> Array:
    """Return the rotation (4,) about the metacarpal's long axis that brings its y nearest the MCP's axis."""
    _, y, z = simulated.truth.hand.axes[JOINTS.index("thumb_mcp"), FLEXION]
    return about_axis(np.array([1.0, 0.0, 0.0]), float(np.arctan2(z, y)))


def facing_the_nail(simulated: Simulated) -> Simulated:
    """Move the thumb metacarpal's receiver about the bone to the nail's side, in recording and truth."""
    mounts, turn = simulated.truth.mounts, nail_turn(simulated)
    receiver = mounts.segments.index(THUMB)
    bone_to_receiver = conjugate(mounts.quaternion[receiver])
    at_mm = mounts.position_mm[receiver]
    moved_mm = rotate(bone_to_receiver, rotate(turn, at_mm) - at_mm)
    turned = multiply(bone_to_receiver, multiply(turn, mounts.quaternion[receiver]))
    position, quaternion = simulated.position_mm.copy(), simulated.quaternion.copy()
    position[:, receiver] += rotate(quaternion[:, receiver], moved_mm)
    quaternion[:, receiver] = multiply(quaternion[:, receiver], turned)
    mcp, cmc = (simulated.truth.joints[name] for name in ("thumb_mcp", "thumb_cmc"))
    back = conjugate(turned)
    child_mm, parent_mm = rotate(back, cmc.child_mm - moved_mm), rotate(back, mcp.parent_mm - moved_mm)
    cmc = replace(cmc, child_mm=child_mm, axis_child=rotate(back, cmc.axis_child))
    mcp = replace(mcp, parent_mm=parent_mm, axis_parent=rotate(back, mcp.axis_parent))
    joints = {**simulated.truth.joints, "thumb_cmc": cmc, "thumb_mcp": mcp}
    truth = replace(simulated.truth, joints=joints)
    return replace(simulated, position_mm=position, quaternion=quaternion, truth=truth)
