"""Possible mistakes in what is declared about a recording; a hypothesis can undo its mistake in poses."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations, permutations, product
from typing import Any

import numpy as np

from shukotsu.hand.rotations import Array, angle, from_matrix, matrix
from shukotsu.hand.sampled_motion import MIRROR, SampledMotion
from shukotsu.study.findings import Values
from shukotsu.study.layout import Layout
from shukotsu.tables.limits import MM_PER_UNIT

SENSES = ("receiver-to-transmitter", "transmitter-to-receiver")
"""Directions of rotations; those of the second kind are inverted on reading."""
CURES = {"": "", "quaternion": "new_mapping_cure"}
"""See `Declared.cure`: without a mapping, by the kind that a reader states."""


@dataclass(frozen=True)
class Declared:
    """Declarations of a mapping; the defaults are those implied by a tidy table's column names.

    format : of the mapping, "" without one. kind, order, rotates, axes, angle_unit : of its orientation; kind
    is `device` for quaternions w, x, y, z that a tracker's protocol defines. cure : key of the sentences of
    cures if the file's reader defines the orientations, which no names of columns or keys of a mapping could
    correct. position_axes : axes of the file that were read as x, y and z.
    """

    format: str = ""
    position_unit: str = "mm"
    kind: str = "quaternion"
    cure: str = ""
    order: str = "wxyz"
    rotates: str = SENSES[0]
    axes: str = ""
    angle_unit: str = ""
    time_unit: str = ""
    rate_hz: float = 0.0
    position_axes: tuple[str, ...] = ("x", "y", "z")

    @property
    def unmapped(self) -> Values:
        """Value of a finding's sentence if there is no mapping in which to correct the mistake."""
        return {} if self.format else {"unmapped": True}

    @classmethod
    def of(cls, mapping: Mapping[str, Any] | None, kind: str = "") -> Declared:
        """Read it from a mapping's keys, or None; kind : of orientations, if the file states it."""
        if mapping is None:
            return cls(kind=kind or cls.kind, cure=CURES.get(kind, "reader_cure"))
        orientation = mapping.get("orientation") or {} if not kind else {}
        usual = "quaternion" if mapping["format"] in ("csv", "xdf") else "matrix"
        cure, kind = "reader_cure" if kind else "", kind or orientation.get("kind", usual)
        declared = {name: mapping[name] for name in ("position_unit", "rate_hz") if name in mapping}
        declared |= {name: orientation[name] for name in ("order", "rotates") if name in orientation}
        declared["axes"] = orientation.get("axes", "") if kind == "euler" else ""
        declared["angle_unit"] = orientation.get("unit", "")
        declared["time_unit"] = mapping.get("csv", {}).get("time_unit", "")
        position_axes = tuple(mapping.get("position_axes", cls.position_axes))
        return cls(mapping["format"], kind=kind, cure=cure, position_axes=position_axes, **declared)


Undo = Callable[[SampledMotion], SampledMotion]
TIDY = Declared()
"""A tidy table: millimetres, and quaternions w, x, y, z from the receiver to the transmitter."""


@dataclass(frozen=True)
class Hypothesis:
    """A possible mistake, which `undo` removes from a motion.

    variant, values : for the sentence of its finding. places : receivers concerned, None for all. penalty :
    prior log odds against it.
    """

    kind: str
    undo: Undo
    variant: str = ""
    values: Values = field(default_factory=dict)
    places: frozenset[int] | None = None
    penalty: float = 0.0


@dataclass(frozen=True)
class Recorded:
    """The recording that hypotheses are about. axes : (S, 3, 3), see `receiver_axes`. hand : as declared."""

    layout: Layout
    segments: tuple[str, ...]
    axes: Array
    hand: str
    is_hand: bool
    declared: Declared

    @property
    def mirror(self) -> Array:
        """Signs of the axes that `SampledMotion` negates: left hands are mirrored."""
        return MIRROR if self.hand == "left" else np.ones(3)

    def mirrored(self, rotation: Array) -> Array:
        """Convert rotations (..., 3, 3) of the recording to those of its `SampledMotion`, or back."""
        return rotation * self.mirror[:, None] * self.mirror


def hypotheses(recorded: Recorded, motion: SampledMotion) -> list[Hypothesis]:
    """Return all mistakes to be tested on the poses of the motion."""
    mistakes = [*_orders(recorded), *_angles(recorded), *_units(recorded.declared), *_axes(recorded)]
    mistakes += [*_hemispheres(recorded, motion), *_swaps(recorded)]
    if recorded.is_hand:
        hand = {"hand": "left" if recorded.hand == "right" else "right", "hand_2": recorded.hand}
        mistakes.append(Hypothesis("wrong-hand", SampledMotion.mirrored, "", hand))
        mistakes += [*_digit_swaps(recorded), *_turns(recorded)]
    rivals = Counter((mistake.kind, mistake.places is None, mistake.penalty) for mistake in mistakes)

    def penalty(mistake: Hypothesis) -> float:
        alike = rivals[mistake.kind, mistake.places is None, mistake.penalty]
        return mistake.penalty + float(np.log(alike / SHARES[mistake.kind]))

    unmapped = recorded.declared.unmapped
    return [replace(each, penalty=penalty(each), values={**each.values, **unmapped}) for each in mistakes]


SHARES = {
    "quaternion-order": 0.02,
    "quaternion-inverse": 0.01,
    "euler-order": 0.03,
    "units": 0.02,
    "axes-mirrored": 0.01,
    "wrong-hand": 0.02,
    "hemisphere": 0.02,
    "receivers-swapped": 0.02,
    "digits-swapped": 0.01,
    "receiver-turned": 0.01,
}
"""Estimated share of recordings that have the mistake, divided equally among the hypotheses of its kind."""


CYCLIC_ORDERS = ("wxyz", "xyzw", "yzwx", "zwxy")
"""Orders that result from confusing w, x, y, z with x, y, z, w once or several times."""
ORDERS = tuple(dict.fromkeys([*CYCLIC_ORDERS, *map("".join, permutations("wxyz"))]))
"""All orders of a quaternion's numbers, cyclic ones first."""
RARE = float(np.log(20.0))
"""Additional log odds against an order that is not cyclic."""

INVERSE = np.array([1.0, -1.0, -1.0, -1.0])
"""Signs that conjugate a unit quaternion."""


def _undo_quaternion_change(recorded: Recorded, change: Callable[[Array], Array]) -> Undo:
    """Return a function that applies `change` to the quaternions as in the file, before any inversion."""
    sense = INVERSE if recorded.declared.rotates == SENSES[1] else np.ones(4)

    def undo(motion: SampledMotion) -> SampledMotion:
        file_rotation = recorded.mirrored(motion.rotation) @ np.swapaxes(recorded.axes, 1, 2)
        turned = matrix(change(from_matrix(file_rotation) * sense) * sense) @ recorded.axes
        return replace(motion, rotation=recorded.mirrored(turned))

    return undo


def _orders(recorded: Recorded) -> Iterator[Hypothesis]:
    """Yield other orders of quaternions and the inverse rotation, as far as the kind of file allows them."""
    declared = recorded.declared
    common: dict[str, Any] = {"rotates": SENSES[1] if declared.rotates == SENSES[0] else SENSES[0]}
    common |= {"cure": declared.cure} if declared.cure else {}
    for order in ORDERS if declared.kind in ("quaternion", "device") else ():
        if order == declared.order:
            continue
        columns = ["wxyz".index(declared.order[order.index(part)]) for part in "wxyz"]
        anew = ", ".join("q" + part for part in order)
        read, true = ", ".join(declared.order), ", ".join(order)
        values = {"read": read, "true": true, "order": order, "anew": anew, **common}
        usual = order in CYCLIC_ORDERS
        variants = {"order": np.ones(4), "inverse-too": INVERSE} if usual else {"order": np.ones(4)}
        for variant, sign in variants.items():

            def reordered(q: Array, columns: list[int] = columns, sign: Array = sign) -> Array:
                return q[..., columns] * sign

            undo, rareness = _undo_quaternion_change(recorded, reordered), 0.0 if usual else RARE
            yield Hypothesis("quaternion-order", undo, variant, values, penalty=rareness)
    if declared.format != "c3d":  # clusters of markers have no orientations that could be inverse
        undo = _undo_quaternion_change(recorded, lambda q: q * INVERSE)
        yield Hypothesis("quaternion-inverse", undo, "", common)


def _angles(recorded: Recorded) -> Iterator[Hypothesis]:
    """Yield mistakes in Euler angles and rotation vectors: another order of axes, and radians as degrees."""
    declared = recorded.declared.axes
    if not declared and recorded.declared.kind != "rotation-vector":
        return
    orders = [("axes", true, true) for true in map("".join, permutations("XYZ")) if true != declared]
    orders.append(("fixed", declared[::-1], declared.lower()))
    for variant, true, axes in orders if declared else ():
        undo = _undo_quaternion_change(recorded, _undo_angle_order(declared, axes))
        yield Hypothesis("euler-order", undo, variant, {"read": declared, "true": true})
    undo = _undo_quaternion_change(recorded, _undo_angle_order(declared, declared, 180 / np.pi))
    yield Hypothesis("units", undo, "radians")


def _undo_angle_order(declared: str, true: str, factor: float = 1.0) -> Callable[[Array], Array]:
    """Return a function that decomposes rotations into angles about the declared axes and recomposes them.

    declared : axes, or "" for rotation vectors. true : axes for composition, in scipy's notation: lower case
    for fixed axes. factor : of the angles.
    """

    def change(quaternion: Array) -> Array:
        from scipy.spatial.transform import Rotation  # slow import, needed only for files with angles

        read = Rotation.from_quat(quaternion.reshape(-1, 4), scalar_first=True)
        if declared:
            with warnings.catch_warnings(action="ignore"):  # in gimbal lock only a sum is determined
                again = Rotation.from_euler(true, factor * read.as_euler(declared))
        else:
            again = Rotation.from_rotvec(factor * read.as_rotvec())
        return np.asarray(again.as_quat(scalar_first=True).reshape(quaternion.shape))

    return change


def _undo_axes(factor: float | Array, order: Sequence[int] = (0, 1, 2)) -> Undo:
    """Return a function that permutes and scales the axes of positions."""
    columns = list(order)
    return lambda motion: replace(motion, position_mm=motion.position_mm[..., columns] * factor)


def _units(declared: Declared) -> Iterator[Hypothesis]:
    read = declared.position_unit
    for true, mm in MM_PER_UNIT.items():
        if true != read:
            factor = mm / MM_PER_UNIT[read]
            variant = "positions-small" if factor > 1 else "positions-large"
            values = {"factor": max(factor, 1 / factor), "true": true, "read": read}
            yield Hypothesis("units", _undo_axes(factor), variant, values)


def _axes(recorded: Recorded) -> Iterator[Hypothesis]:
    """Yield exchanges and negations of the axes of positions but not of rotations; none for C3D files."""
    if recorded.declared.format == "c3d":
        return
    names, read = "xyz", recorded.declared.position_axes
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            # all axes negated is the hypothesis of a wrong hemisphere
            if order == (0, 1, 2) and (min(signs) > 0 or max(signs) < 0):
                continue
            sign = np.array(signs) * recorded.mirror * recorded.mirror[list(order)]
            columns = [read[i] if s > 0 else f"-{read[i]}" for i, s in zip(order, signs, strict=True)]
            values: dict[str, Any] = {"columns": ", ".join(columns).replace("--", "")}
            variant = "exchanged"
            if order == (0, 1, 2):
                variant, negated = "negated", [n for n, s in zip(names, signs, strict=True) if s < 0]
                values |= {"negated": negated, "count": len(negated)}
            yield Hypothesis("axes-mirrored", _undo_axes(sign, order), variant, values)


def _hemispheres(recorded: Recorded, motion: SampledMotion) -> Iterator[Hypothesis]:
    """Yield wrong hemispheres: of one receiver, of all receivers opposite to the majority, or of all."""
    if recorded.declared.format != "c3d":  # cameras have no hemisphere
        yield Hypothesis("hemisphere", _undo_axes(-1.0), "whole")
    centre = np.median(motion.position_mm, axis=0)
    side = centre @ np.linalg.eigh(centre.T @ centre)[1][:, -1]
    behind = side < 0 if (side < 0).sum() <= len(side) / 2 else side > 0  # opposite to the majority
    groups = [{receiver} for receiver in range(len(recorded.segments))]
    if behind.sum() > 1:
        groups.append({*np.flatnonzero(behind).tolist()})
    for receivers in groups:
        sign = np.ones((len(recorded.segments), 1))
        sign[list(receivers)] = -1.0
        names = [recorded.segments[receiver] for receiver in sorted(receivers)]
        values = {"segments": names, "count": len(names)}
        yield Hypothesis("hemisphere", _undo_axes(sign), "all-along", values, frozenset(receivers))


def _swaps(recorded: Recorded) -> Iterator[Hypothesis]:
    for first, second in combinations(range(len(recorded.segments)), 2):
        pair = {"segment": recorded.segments[first], "segment_2": recorded.segments[second]}
        undo = _undo_exchange(recorded, [first], [second])
        yield Hypothesis("receivers-swapped", undo, "", pair, frozenset({first, second}))


def _digit_swaps(recorded: Recorded) -> Iterator[Hypothesis]:
    worn = {
        name: [recorded.segments.index(s) for s in digit.segments if s in recorded.segments]
        for name, digit in recorded.layout.digits.items()
    }
    for first, second in combinations(worn, 2):
        if len(worn[first]) != len(worn[second]):
            continue
        named = (second, first) if second == "thumb" else (first, second)  # the sentence names a finger last
        digits = dict(zip(("digit", "digit_2"), named, strict=True))
        values = {**digits, "pairs": _pairs(recorded, worn[first], worn[second])}
        undo = _undo_exchange(recorded, worn[first], worn[second])
        yield Hypothesis("digits-swapped", undo, "two", values, frozenset({*worn[first], *worn[second]}))
    fingers = [receivers for name, receivers in worn.items() if name != "thumb"]
    if len(fingers) > 2 and len({len(receivers) for receivers in fingers}) == 1:
        half = len(fingers) // 2
        near = [*chain.from_iterable(fingers[:half])]
        far = [*chain.from_iterable(fingers[: -half - 1 : -1])]
        pairs, undo = _pairs(recorded, near, far), _undo_exchange(recorded, near, far)
        yield Hypothesis("digits-swapped", undo, "reversed", {"pairs": pairs})


def _pairs(recorded: Recorded, first: Sequence[int], second: Sequence[int]) -> list[list[str]]:
    """Return the pairs of names of corresponding segments, of two digits or of two groups of digits."""
    return [[recorded.segments[i] for i in pair] for pair in zip(first, second, strict=True)]


def _undo_exchange(recorded: Recorded, first: Sequence[int], second: Sequence[int]) -> Undo:
    """Return a function that undoes an exchange of receivers, with the axes of each mounting corrected.

    first, second : indices of segments; each of the first has the poses of its counterpart in the second.
    """
    rows = np.arange(len(recorded.segments))
    rows[[*first, *second]] = [*second, *first]
    exchange = recorded.mirrored(np.swapaxes(recorded.axes[rows], 1, 2) @ recorded.axes)

    def undo(motion: SampledMotion) -> SampledMotion:
        rotation = motion.rotation[:, rows] @ exchange
        return SampledMotion(motion.position_mm[:, rows], rotation, motion.valid[:, rows])

    return undo


def _turns(recorded: Recorded) -> Iterator[Hypothesis]:
    """Yield quarter, half and third turns of one receiver, or of all receivers, on the bones."""
    for turn in _cube_turns():
        in_receiver = recorded.mirrored(turn)
        values = _turn_values(in_receiver)
        axes = recorded.axes @ in_receiver  # columns are the bone's axes in the receiver's frame
        if np.ptp(axes, axis=0).max() < ALIKE:
            yield Hypothesis("receiver-turned", _undo_turn(turn), "all", values | _axes_values(axes[0]))
        for index, segment in enumerate(recorded.segments):
            of_one = values | _axes_values(axes[index]) | {"segment": segment}
            yield Hypothesis("receiver-turned", _undo_turn(turn, index), "one", of_one, frozenset({index}))


def _cube_turns() -> Array:
    """Return the rotation matrices (23, 3, 3) of a cube's symmetries: quarter, half and third turns."""
    whole = np.array([*product((1.0, 0.0, -1.0), repeat=4)])
    parts = (whole != 0).sum(1)
    # q and -q are the same rotation, so the first component that is not 0 must be positive
    first = np.take_along_axis(whole, (whole != 0).argmax(1)[:, None], 1)[:, 0]
    kept = (first > 0) & np.isin(parts, (1, 2, 4)) & whole[:, 1:].any(1)
    return matrix(whole[kept] / np.sqrt(parts[kept])[:, None]).round() + 0.0


ALIKE = 1e-6
"""Largest difference of receivers' axes that count as equal in the layout."""


def _axes_values(axes: Array) -> dict[str, Any]:
    """Return receiver axes (3, 3) as keys of a layout; whole numbers without decimals."""
    whole = axes.round(6) + 0.0
    return {
        name: [int(v) if v == int(v) else float(v) for v in whole[:, i]]
        for i, name in enumerate(("distal", "lateral", "dorsal"))
    }


def _undo_turn(turn: Array, receiver: int | slice = slice(None)) -> Undo:
    def undo(motion: SampledMotion) -> SampledMotion:
        rotation = motion.rotation.copy()
        rotation[:, receiver] = rotation[:, receiver] @ turn
        return replace(motion, rotation=rotation)

    return undo


def _turn_values(in_receiver: Array) -> dict[str, Any]:
    """Return the angle in degrees and the receiver's axis of a turn; the axis is "" for a diagonal."""
    turned = from_matrix(in_receiver)
    degrees, axis = round(float(np.degrees(angle(turned)))), turned[1:]
    along = np.flatnonzero(np.abs(axis) > 0.3)
    if len(along) == 1:
        sign = -1 if axis[along[0]] < 0 and degrees != 180 else 1
        return {"turn_deg": sign * degrees, "turn_axis": "xyz"[along[0]]}
    return {"turn_deg": degrees, "turn_axis": ""}
