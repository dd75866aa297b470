"""People who differ from the prior: drawn around a source that is left out of it, with other laws of skin."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from unittest import mock

import numpy as np

from benchmarks import two_drawings
from benchmarks.benchmark_table import PrintedTable, Row, of_each_person, percent
from benchmarks.two_drawings import DURATION_S, JOINT_TYPES, Drawn, JointErrors, LengthError, centre_numbers
from shukotsu.arrays import Array
from shukotsu.fit.fit import HandFit, fit_hand
from shukotsu.hand import drawn_hands, rotations
from shukotsu.hand.average_hand import BONE_KINDS, DIGITS, PRIOR, DigitAnatomy
from shukotsu.hand.drawn_hands import drawn
from shukotsu.simulate.forward import PoseArrays, bone_poses
from shukotsu.simulate.mounts import Mounts, Skin, lag_signal, wander
from shukotsu.simulate.random_hand import BONES, FLEXION, RandomHand
from shukotsu.simulate.realism import Realism, generator
from shukotsu.simulate.simulation import LAYOUT, simulate
from shukotsu.simulate.task_motion import TaskMotion
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import RecordingName

WRITTEN_TO = "accuracy.md", "sources"
PEOPLE = 10, 7100

SHIPPED = "none: as shipped"

# --- the prior without a source

CONSTANTS_WITHOUT: Mapping[str, Mapping[str, float]] = {
    "chang": {"SKEW_MM": 0.0, "SKEW_DEG": 90.0},
    "cadavers": {"PRO_SUPINATION": 0.4, "HINGE_SLIDE_SD_MM": 0.1},
}
"""Values of the prior without these sources: thumb axes that meet, as in MyoHand; other pro-supination of
metacarpals, and hinges that hardly glide."""

RIG = "a rig"
LEFT_OUT = (*drawn_hands.SOURCES, *CONSTANTS_WITHOUT, RIG, SHIPPED)

MYOHAND_HEIGHT_MM = 5.4
"""Height of the back of metacarpals and proximal phalanges above the line of joints in the only hand besides
the CT sets."""


def prior_without(source: str) -> Mapping[str, DigitAnatomy]:
    """Return average digits from all sources except one; values that only this source has are kept."""
    if source not in drawn_hands.SOURCES:
        return DIGITS
    rest = {name: hand for name, hand in drawn_hands.SOURCES.items() if name != source}
    shares = np.array(
        [s for name, s in zip(drawn_hands.SOURCES, drawn.BLEND_SHARES, strict=True) if name in rest]
    )
    lengths = drawn_hands.blend_hands(list(rest.values()), shares / shares.sum())
    digits = dict(DIGITS)
    if source == "ct":  # the X-ray hand has everything except its lengths from this source
        others = drawn_hands.blend_hands([drawn_hands.BUCHHOLZ, drawn_hands.MYOHAND], [0.5, 0.5])
        digits = {name: _as_anatomy(others[name], digit) for name, digit in DIGITS.items()}
    elif source == "myohand":
        digits |= {name: _in_line(name) for name in drawn.ROLL_DEG}
    return {name: replace(digit, lengths_mm=lengths[name].lengths_mm) for name, digit in digits.items()}


def _as_anatomy(digit: drawn_hands.DrawnDigit, like: DigitAnatomy) -> DigitAnatomy:
    heights_mm = like.bone_heights_mm.copy()
    heights_mm[:2] = np.minimum(heights_mm[:2], MYOHAND_HEIGHT_MM)
    axes = rotations.unit(digit.flexion_axes)
    placed = replace(like, base_mm=digit.base_mm, directions=digit.directions, flexion_axes=axes)
    return replace(placed, bone_heights_mm=heights_mm, second_axis=digit.second_axis)


def _in_line(name: str) -> DigitAnatomy:
    """Return a finger in line with its metacarpal, with hinges along the row of Buchholz' knuckles."""
    row = [drawn_hands.BUCHHOLZ[finger] for finger in drawn.ROLL_DEG]
    knuckles = [finger.base_mm + finger.lengths_mm[0] * finger.directions[0] for finger in row]
    at = list(drawn.ROLL_DEG).index(name)
    across = knuckles[max(0, at - 1)] - knuckles[min(len(row) - 1, at + 1)]
    along = np.tile(row[at].directions[0], (4, 1))
    axis = rotations.unit(across - (across @ along[0]) * along[0])
    frame = rotations.from_matrix(np.stack([along[0], axis, np.cross(along[0], axis)], -1))
    axes = rotations.rotate(frame, DIGITS[name].flexion_axes @ DIGITS[name].frames()[1])  # hinges as in CT
    axes[:2] = axis
    return replace(DIGITS[name], base_mm=row[at].base_mm, directions=along, flexion_axes=rotations.unit(axes))


def _rigged(name: str, digit: drawn_hands.DrawnDigit) -> drawn_hands.DrawnDigit:
    """Return a digit as drawn for rigging a mesh: palm broad and long, plain hinges, straight fingers."""
    if name == "thumb":
        base = digit.base_mm + np.array([-4.0, 2.0, 3.0])
        return replace(digit, base_mm=base, lengths_mm=digit.lengths_mm * [1.1, 1.0, 0.95])
    wider, back_mm = np.array([1.0, 1.2, 1.0]), np.array([-6.0, 0.0, 0.0])
    base = digit.base_mm * wider + back_mm
    metacarpal = digit.base_mm * wider + digit.lengths_mm[0] * digit.directions[0] * wider - base
    along, across = digit.directions[1], digit.flexion_axes[1]
    across = rotations.unit(across - (across @ along) * along + [0.0, 0.3, 0.0])
    lengths = np.array([np.linalg.norm(metacarpal), *(digit.lengths_mm[1:] * [1.03, 0.95, 1.05])])
    directions = np.array([rotations.unit(metacarpal), *[along] * 3])
    axes = np.tile(across, (4, 1))
    return replace(digit, base_mm=base, directions=directions, lengths_mm=lengths, flexion_axes=axes)


RIGGED: drawn_hands.DrawnHand = {name: _rigged(name, digit) for name, digit in drawn_hands.CT.items()}

# --- other skins

PERSON, MESH, SIMULATION = "sources", "mesh", "shukotsu.simulate.simulation"
LATE_S = 0.4


def _follow(
    law: str, angles_rad: Array, skin: Skin, of_hand: np.random.Generator, of_recording: np.random.Generator
) -> tuple[Array, Array]:
    """Return slide, mm, and turn, rad, (T, S, 3) by another law of skin than `simulate.mounts.saturating`."""
    if law == MESH:  # the receivers were already moved by `ride_on_mesh`
        still = np.zeros((len(angles_rad), len(skin.bone), 3))
        return still, still
    loose = (skin.looseness[:, None] * skin.present)[..., None]
    slide = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.SLIDE_SD_MM * loose
    tilt = of_hand.standard_normal((len(skin.bone), 2, 3)) * drawn.TILT_SD * loose
    drive = angles_rad[..., FLEXION]
    if law == "one joint":
        slide[:, 1], tilt[:, 1] = 0.0, 0.0
    elif law == "lagging":
        drive = drive[:1] + lag_signal(drive - drive[:1], LATE_S)
    off = wander(of_recording, len(drive), len(skin.bone)) * skin.looseness[:, None]
    return (
        np.einsum("tsa,sax->tsx", drive[:, skin.joint], slide) + drawn.WANDER_MM * off[0],
        np.einsum("tsa,sax->tsx", drive[:, skin.joint], tilt) + np.radians(drawn.WANDER_DEG) * off[1],
    )


BLEND_MM = (4.5, 8.0)
"""Least and largest distance from a joint over which weights of the mesh decrease by a factor e."""

HOUSING_MM = (2.0, 4.0)
"""Least and largest additional height of the tracked point above the skin, compared with the simulator's
receivers."""

RIDGE_MM = {"thumb": 2.0, "index": 2.5, "middle": 1.0, "ring": -1.5, "little": -2.5}
"""Radial offset of the middle of a digit's back from the line of joints in the mesh, equal in all hands."""

ROUND_DEG = 7.0
"""Sd of a receiver's angular position on the round back of its digit."""

HALF_BASE_MM = 3.0


def ride_on_mesh(
    seed: int, hand: RandomHand, mounts: Mounts, motion: TaskMotion, _: Array, bones: PoseArrays, *__: Skin
) -> PoseArrays:
    """Return poses of receivers on tubes around the digits, moved by linear-blend weights.

    A vertex follows its bone and both neighbours, whose weights are a half at the joint between them and
    decrease exponentially with the distance from it. A receiver's base is on five vertices.
    """
    rng = generator(seed, "mesh", hand.side)
    blend_mm, higher_mm = rng.uniform(*BLEND_MM), rng.uniform(*HOUSING_MM)
    rest = bone_poses(hand, np.zeros_like(motion.angles_rad[:1]), motion.wrist_mm[:1], motion.forearm[:1])
    position, quaternion = mounts.poses(*bones)
    side = -1.0 if hand.side == "left" else 1.0
    for s, (segment, bone) in enumerate(zip(mounts.segments, mounts.bone, strict=True)):
        digit = segment.split("_")[0]
        if digit not in RIDGE_MM:
            continue
        place = mounts.position_mm[s] + [0.0, side * RIDGE_MM[digit], 0.0]
        aside = rotations.about_axis(np.array([1.0, 0.0, 0.0]), np.radians(ROUND_DEG) * rng.standard_normal())
        turn = rotations.multiply(aside, mounts.quaternion[s])
        base = rotations.rotate(
            turn, HALF_BASE_MM * np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]])
        )
        vertices = rotations.rotate(aside, place) + base
        carried = _blended(hand, bone, vertices, rest, bones, blend_mm)
        middle, ahead, behind, left, right = carried.swapaxes(0, 1)
        x = rotations.unit(ahead - behind)
        y = left - right
        y = rotations.unit(y - (y * x).sum(-1, keepdims=True) * x)
        frame = np.stack([x, y, np.cross(x, y)], -1)
        quaternion[:, s] = rotations.from_matrix(frame)
        position[:, s] = middle + higher_mm * frame[..., 2]
    return position, quaternion


def _blended(
    hand: RandomHand, bone: int, vertices: Array, rest: PoseArrays, bones: PoseArrays, blend_mm: float
) -> Array:
    """Return positions (T, V, 3) to which the mesh carries vertices (V, 3) in their bone's frame at rest."""
    name = BONES[bone]
    chain = [b for b, other in enumerate(BONES) if other.startswith(f"{name.split('_')[0]}_")]
    at = chain.index(bone)
    before = BONES.index("hand") if at == 0 else chain[at - 1]
    x = vertices[:, 0]
    shares = {before: 0.5 * np.exp(-np.maximum(x, 0.0) / blend_mm)}
    if at + 1 < len(chain):
        shares[chain[at + 1]] = 0.5 * np.exp(-np.maximum(hand.length_mm[bone] - x, 0.0) / blend_mm)
    shares[bone] = 1.0 - np.sum(list(shares.values()), axis=0)
    world = rest[0][0, bone] + rotations.rotate(rest[1][0, bone], vertices)
    carried = np.zeros((len(bones[0]), *vertices.shape))
    for other, share in shares.items():
        local = rotations.rotate(rotations.conjugate(rest[1][0, other]), world - rest[0][0, other])
        moved = bones[0][:, None, other] + rotations.rotate(bones[1][:, None, other], local)
        carried += share[:, None] * moved
    return carried


SATURATING, STILL = "saturating", "no skin motion"
SKINS = (SATURATING, MESH, "one joint", "two joints", "lagging", STILL)


@dataclass(frozen=True)
class Fitted:
    """Errors of the fit of a hand drawn around a source, with a law of skin."""

    source: str
    skin: str
    joints: tuple[JointErrors, ...]
    lengths: tuple[LengthError, ...]


def run(n_hands: int, seed: int) -> Iterator[PrintedTable]:
    """Yield the tables over n_hands hands of every source."""
    hands = of_each_person(partial(one_hand, seed), n_hands * len(LEFT_OUT), seed)
    left_out = [hand for hand in hands if hand.source not in (RIG, SHIPPED)]
    sources = {name: [hand for hand in hands if hand.source == name] for name in LEFT_OUT}
    yield _table(
        "prior without a source: by source", "source", {"all that are left out": left_out, **sources}
    )
    skins = {skin: [hand for hand in left_out if hand.skin == skin] for skin in SKINS}
    yield _table("prior without a source: by skin", "skin", skins)
    yield _parts_table(left_out)


def one_hand(first_seed: int, seed: int) -> Fitted:
    """Draw, record and fit a hand; sources and skins alternate, so that all are combined."""
    turn, at = divmod(seed - first_seed, len(LEFT_OUT))
    source = LEFT_OUT[at]
    skin = MESH if source == RIG else SKINS[(turn + at) % len(SKINS)]
    person = draw(source, skin, seed, ("right", "left")[seed % 2])
    fit = fit_without(source, person)
    joints = two_drawings.joint_errors(person, fit)
    lengths = two_drawings.length_errors(person, fit)
    return Fitted(source, skin, tuple(joints), tuple(lengths))


def draw(source: str, skin: str, seed: int, hand: str) -> Drawn:
    """Record a person drawn around a source (a blend of all if it is no whole hand), with a law of skin."""
    anatomy = source if source in (*drawn_hands.SOURCES, RIG) else drawn_hands.BLEND
    realism = Realism(anatomy=anatomy, artefact=0.0 if skin == STILL else 1.0)
    with ExitStack() as stack:
        if source == RIG:
            stack.enter_context(mock.patch.dict(drawn_hands.SOURCES, {RIG: RIGGED}))
        if skin == MESH:
            stack.enter_context(mock.patch(f"{SIMULATION}.on_skin", partial(ride_on_mesh, seed)))
        if skin not in (SATURATING, STILL):
            stack.enter_context(mock.patch(f"{SIMULATION}.saturating", partial(_follow, skin)))
        name = RecordingName(PERSON, hand, "rom")
        simulated = simulate(name, seed, realism, round(240 * DURATION_S))
    return two_drawings.simulated_hand(simulated)


def fit_without(source: str, person: Drawn) -> HandFit:
    """Fit a hand with a prior without a source."""
    digits = prior_without(source)
    constants = CONSTANTS_WITHOUT.get(source, {})
    with mock.patch.dict(DIGITS, digits), mock.patch.dict(vars(PRIOR), constants):
        return fit_hand([person.poses], read_layout(LAYOUT), person.hand)


def _table(title: str, what: str, groups: Mapping[str, Sequence[Fitted]]) -> PrintedTable:
    """Return the table of errors and coverage of groups of hands."""
    rows: list[Row] = []
    for name, hands in groups.items():
        joints = [joint for hand in hands for joint in hand.joints]
        if not joints:
            continue
        worse_mm, stated_mm = np.array([(error.worse_mm, error.sd_mm) for error in joints]).T
        lengths = percent([length.inside for hand in hands for length in hand.lengths])
        believed = percent([error.believed for error in joints])
        ratio = float(np.sqrt((worse_mm**2).mean() / (stated_mm**2).mean()))
        rows.append(
            (name, len(hands), *centre_numbers(joints), lengths, ratio, float(stated_mm.mean()), believed)
        )
    columns = (
        what, "hands:d", "median mm:.2f", "p90 mm:.2f", "in 95 %:.1f", "lengths in 95 %:.1f", "rms / sd:.2f",
        "mean sd mm:.2f", "believed %:.0f",
    )  # fmt: skip
    meaning = (
        "People drawn around a source that is left out of the prior; a rig: a skeleton as drawn for rigging "
        "a mesh, with the prior as shipped. Centres in the child's receiver. In 95 %: centres in the "
        "parent's and in the child's receiver, compared with their covariance. Rms / sd: root mean square "
        "error of the worse half over that of its stated sd."
    )
    return PrintedTable(title, columns, rows, meaning)


def _parts_table(hands: Sequence[Fitted]) -> PrintedTable:
    """Return the table of coverage by kind of joint, and of lengths by digit and by bone."""
    joints = [joint for hand in hands for joint in hand.joints]
    lengths = [length for hand in hands for length in hand.lengths]
    rows: list[Row] = [
        (kind, *centre_numbers([error for error in joints if error.joint in names]))
        for kind, names in JOINT_TYPES.items()
    ]
    parts = [(0, digit) for digit in drawn.LENGTH_SD_MM]
    parts += [(1, kind) for kind in BONE_KINDS[:-1]]
    for place, part in parts:
        of_part = [length for length in lengths if length.bone.split("_")[place] == part]
        mm, inside = [abs(length.off_mm) for length in of_part], [length.inside for length in of_part]
        name = f"lengths: {part} {('digit', 'bones')[place]}"
        rows.append((name, float(np.median(mm)), float(np.percentile(mm, 90)), percent(inside)))
    columns = ("joints or lengths", "median mm:.2f", "p90 mm:.2f", "in 95 %:.1f")
    title = "prior without a source: by kind of joint, and lengths by digit and by bone"
    return PrintedTable(title, columns, rows, "Over all sources that are left out.")
