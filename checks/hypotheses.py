"""What else than declared may hold of a recording, each hypothesis a change to its poses that undoes it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np

from checks.declared import TIDY, Declared
from checks.sampled_motion import MIRROR, Motion
from schemas.layout import Layout
from skeleton.rotations import Array, from_matrix, matrix


@dataclass(frozen=True)
class Hypothesis:
    """One mistake. undo : gives the motion without it. penalty : how much less likely than none it is before
    any pose is seen, in log units. places : the receivers concerned; None: all. what, cure : halves of its
    sentence.
    """

    kind: str
    penalty: float
    undo: Callable[[Motion], Motion]
    what: str
    cure: str
    places: frozenset[int] | None = None


@dataclass(frozen=True)
class Recorded:
    """What the hypotheses are about. axes : (S, 3, 3), see `receiver_axes`. hand : as declared."""

    layout: Layout
    segments: tuple[str, ...]
    axes: Array
    hand: str
    is_hand: bool
    declared: Declared = TIDY

    @property
    def mirror(self) -> Array:
        """Signs of the axes that `Motion` has turned over."""
        return MIRROR if self.hand == "left" else np.ones(3)


def hypotheses(recorded: Recorded, motion: Motion) -> list[Hypothesis]:
    """Give every mistake that is looked for by explaining the poses of the motion otherwise."""
    found = [*_orders(recorded), *_euler(recorded), *_units(), *_axes(recorded)]
    found += [*_hemispheres(recorded, motion), *_swaps(recorded)]
    if recorded.is_hand:
        found += [_other_hand(recorded), *_digit_swaps(recorded), *_turns(recorded)]
    rivals = Counter((one.kind, one.places is None) for one in found)
    return [
        replace(one, penalty=float(np.log(rivals[one.kind, one.places is None] / SHARES[one.kind])))
        for one in found
    ]


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
"""Of a laboratory's recordings that have the mistake (ours): what they share, its hypotheses share alike."""


def _requaternioned(recorded: Recorded, change: Callable[[Array], Array]) -> Callable[[Motion], Motion]:
    def undo(motion: Motion) -> Motion:
        mirror = recorded.mirror
        own = (motion.rotation * mirror[:, None] * mirror) @ np.swapaxes(recorded.axes, 1, 2)
        turned = matrix(change(from_matrix(own))) @ recorded.axes
        return replace(motion, rotation=turned * mirror[:, None] * mirror)

    return undo


def _orders(recorded: Recorded) -> Iterator[Hypothesis]:
    orders = {
        "quaternion-order": [
            ("the quaternions are read as w, x, y, z and seem to be x, y, z, w",
             "write `order: xyzw` under `orientation` in the mapping, or put qw, qx, qy, qz in that order",
             lambda q: q[..., [3, 0, 1, 2]]),
            ("the quaternions are read as x, y, z, w and seem to be w, x, y, z",
             "write `order: wxyz` under `orientation` in the mapping, or put qw, qx, qy, qz in that order",
             lambda q: q[..., [1, 2, 3, 0]]),
        ],
        "quaternion-inverse": [
            ("the rotations seem to be the inverse of what is declared",
             "write `rotates: transmitter-to-receiver` under `orientation` in the mapping, or "
             "negate qx, qy and qz",
             lambda q: q * [1, -1, -1, -1]),
        ],
    }  # fmt: skip
    for kind, entries in orders.items():
        for what, cure, change in entries:
            yield Hypothesis(kind, 2.0, _requaternioned(recorded, change), what, cure)
    both = lambda q: q[..., [3, 0, 1, 2]] * np.array([1, -1, -1, -1])  # noqa: E731
    yield Hypothesis(
        "quaternion-order", 5.0, _requaternioned(recorded, both),
        "the quaternions seem to be x, y, z, w of the inverse rotation",
        "write `order: xyzw` and `rotates: transmitter-to-receiver` under `orientation` in the mapping",
    )  # fmt: skip


def _euler(recorded: Recorded) -> Iterator[Hypothesis]:
    declared = recorded.declared.axes
    if not declared:
        return
    for true in map("".join, permutations("XYZ")):
        if true != declared:
            yield Hypothesis(
                "euler-order", 3.0, _requaternioned(recorded, _reordered(declared, true, 1.0)),
                f"the angles are read as {declared} and seem to be {true}",
                f"write `axes: {true}` under `orientation` in the mapping",
            )  # fmt: skip
    yield Hypothesis(
        "euler-order", 3.0, _requaternioned(recorded, _reordered(declared, declared, 1.0, backwards=True)),
        f"the angles are read as {declared} about turning axes and seem to be about fixed ones",
        f"write `axes: {declared[::-1]}` under `orientation` in the mapping, the columns in that order",
    )  # fmt: skip
    yield Hypothesis(
        "units", 3.0, _requaternioned(recorded, _reordered(declared, declared, 180 / np.pi)),
        "the angles are read as degrees and seem to be radians",
        "write `unit: rad` under `orientation` in the mapping",
    )  # fmt: skip


def _reordered(
    declared: str, true: str, factor: float, *, backwards: bool = False
) -> Callable[[Array], Array]:
    """Take rotations apart into angles about the declared axes, put them together about the true ones."""
    i, j, k = ("XYZ".index(axis) for axis in declared)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0

    def change(quaternion: Array) -> Array:
        m = matrix(quaternion)
        first = np.arctan2(-sign * m[..., j, k], m[..., k, k])
        second = np.arcsin(np.clip(sign * m[..., i, k], -1, 1))
        third = np.arctan2(-sign * m[..., i, j], m[..., i, i])
        turns = [_about("XYZ".index(axis), factor * angle)
                 for axis, angle in zip(true, (first, second, third), strict=True)]  # fmt: skip
        one, two, three = turns[::-1] if backwards else turns
        return from_matrix(one @ two @ three)

    return change


def _about(axis: int, angle: Array) -> Array:
    out = np.zeros((*angle.shape, 3, 3))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., j, j] = out[..., k, k] = np.cos(angle)
    out[..., j, k], out[..., k, j] = -np.sin(angle), np.sin(angle)
    return out


_FACTORS = (
    (1000.0, "mm", "m"), (0.001, "m", "mm"), (10.0, "mm", "cm"), (0.1, "cm", "mm"), (25.4, "mm", "inch"),
    (1 / 25.4, "inch", "mm"), (2.54, "cm", "inch"), (1 / 2.54, "inch", "cm"), (100.0, "cm", "m"),
    (0.01, "m", "cm"), (39.37, "inch", "m"), (1 / 39.37, "m", "inch"),
)  # fmt: skip


def _moved(factor: float | Array, order: Sequence[int] = (0, 1, 2)) -> Callable[[Motion], Motion]:
    """Take the positions' axes in another order and scale them."""
    columns = list(order)
    return lambda motion: replace(motion, position_mm=motion.position_mm[..., columns] * factor)


def _units() -> Iterator[Hypothesis]:
    for factor, read, true in _FACTORS:
        size = f"{factor:.4g} times too small" if factor > 1 else f"{1 / factor:.4g} times too large"
        yield Hypothesis(
            "units", 3.0, _moved(factor),
            f"the positions are {size}, in {true} and read as {read}",
            f"write `position_unit: {true}` in the mapping, or give positions in mm",
        )  # fmt: skip


def _axes(recorded: Recorded) -> Iterator[Hypothesis]:
    """Positions whose axes are exchanged or negated while the rotations' are not."""
    names = "xyz"
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and min(signs) > 0:
                continue
            sign = np.array(signs) * recorded.mirror * recorded.mirror[list(order)]
            axes = ", ".join(f"{'-' if s < 0 else ''}{names[i]}" for i, s in zip(order, signs, strict=True))
            mirrored = order == (0, 1, 2)
            negated = " and ".join(n for n, s in zip(names, signs, strict=True) if s < 0)
            if signs == (-1.0, -1.0, -1.0):
                negated = "x, y and z"
            what = f"the positions' axes x, y, z seem to be {axes} of the rotations' frame"
            if mirrored:
                what = f"the positions' {negated} seem{'s' * (len(negated) == 1)} to be negated"
            cure = f"write the positions' columns as {axes}, so that positions and rotations share a frame"
            yield Hypothesis(
                "axes-mirrored", 3.0 if mirrored else 5.0,
                _moved(sign, order), what, cure,
            )  # fmt: skip


def _other_hand(recorded: Recorded) -> Hypothesis:
    other = "left" if recorded.hand == "right" else "right"
    return Hypothesis(
        "wrong-hand", 2.0, Motion.mirrored, f"this seems to be a {other} hand",
        f"write `{other}` in the column hand of the recordings sheet (or --hand {other}), or mirror the "
        "positions and rotations back",
    )  # fmt: skip


def _hemispheres(recorded: Recorded, motion: Motion) -> Iterator[Hypothesis]:
    """One receiver on the other side, or all of those that are opposite to most."""
    opposite = _opposite(motion)
    for places in [*({place} for place in range(len(recorded.segments))), *([opposite] if opposite else [])]:
        sign = np.ones((len(recorded.segments), 1))
        sign[list(places)] = -1.0
        names = ", ".join(recorded.segments[place] for place in sorted(places))
        who = f"the receiver {names} seems" if len(places) == 1 else f"the receivers {names} seem"
        yield Hypothesis(
            "hemisphere", 4.0, _moved(sign),
            f"{who} to be on the other side of the transmitter all along",
            "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)",
            frozenset(places),
        )  # fmt: skip


def _opposite(motion: Motion) -> set[int]:
    """Receivers that are on the other side of the transmitter than most; none where that is one or none."""
    place = np.median(motion.position_mm, axis=0)
    side = place @ np.linalg.eigh(place.T @ place)[1][:, -1]
    behind = side < 0 if (side < 0).sum() <= len(side) / 2 else side > 0
    return {int(i) for i in np.flatnonzero(behind)} if behind.sum() > 1 else set()


def _swaps(recorded: Recorded) -> Iterator[Hypothesis]:
    for first, second in combinations(range(len(recorded.segments)), 2):
        pair = recorded.segments[first], recorded.segments[second]
        order = list(range(len(recorded.segments)))
        order[first], order[second] = second, first
        yield Hypothesis(
            "receivers-swapped", 5.0, _permuted(recorded, order),
            f"the receivers {pair[0]} and {pair[1]} seem to be swapped",
            "exchange them in the layout or the mapping", frozenset({first, second}),
        )  # fmt: skip


def _digit_swaps(recorded: Recorded) -> Iterator[Hypothesis]:
    worn = {
        name: [recorded.segments.index(s) for s in digit.segments if s in recorded.segments]
        for name, digit in recorded.layout.digits.items()
    }
    for first, second in combinations(worn, 2):
        if len(worn[first]) != len(worn[second]):
            continue
        order = list(range(len(recorded.segments)))
        for one, other in zip(worn[first], worn[second], strict=True):
            order[one], order[other] = other, one
        yield Hypothesis(
            "digits-swapped", 4.0, _permuted(recorded, order),
            f"the {first} and the {second} finger seem to be swapped".replace("thumb finger", "thumb"),
            "exchange their receivers in the layout or the mapping", frozenset({*worn[first], *worn[second]}),
        )  # fmt: skip
    fingers = [own for name, own in worn.items() if name != "thumb"]
    if len(fingers) > 2 and len({len(own) for own in fingers}) == 1:
        order = list(range(len(recorded.segments)))
        for worn_on, stands_for in zip(fingers, fingers[::-1], strict=True):
            for one, two in zip(worn_on, stands_for, strict=True):
                order[one] = two
        yield Hypothesis(
            "digits-swapped", 5.0, _permuted(recorded, order),
            "the fingers seem to be named in the opposite order", "name them from index to little finger "
            "in the layout or the mapping",
        )  # fmt: skip


def _permuted(recorded: Recorded, order: Sequence[int]) -> Callable[[Motion], Motion]:
    """Each segment takes the pose of the receiver that it stands for, mounted by its own axes."""
    rows = list(order)
    exchange = (
        np.swapaxes(recorded.axes[rows], 1, 2) @ recorded.axes * recorded.mirror[:, None] * recorded.mirror
    )

    def undo(motion: Motion) -> Motion:
        return Motion(motion.position_mm[:, rows], motion.rotation[:, rows] @ exchange, motion.valid[:, rows])

    return undo


def _turns(recorded: Recorded) -> Iterator[Hypothesis]:
    """A receiver, or every receiver alike, turned on its bone by quarter turns."""
    every = len(recorded.segments)
    for turn in _quarter_turns():
        how = _turn_name(turn, recorded.mirror)
        axes = (turn * recorded.mirror[:, None] * recorded.mirror).round().astype(int)
        # a column of `turn` is where the bone's axis points in the receiver's frame
        text = ", ".join(
            f"{n}: {axes[:, i].tolist()}" for i, n in ((0, "distal"), (1, "lateral"), (2, "dorsal"))
        )
        yield Hypothesis(
            "receiver-turned", 4.0, _turned(np.tile(turn, (every, 1, 1))),
            f"all receivers seem to be turned on their bones by {how}",
            f"write `receiver_axes: {{{text}}}` in the layout",
        )  # fmt: skip
        for place, segment in enumerate(recorded.segments):
            yield Hypothesis(
                "receiver-turned", 6.0, _turned_at(place, turn),
                f"the receiver {segment} seems to be turned on its bone by {how}",
                f"write `receiver_axes: {{{text}}}` under the segment {segment} in the layout",
                frozenset({place}),
            )  # fmt: skip


def _turned(turns: Array) -> Callable[[Motion], Motion]:
    return lambda motion: replace(motion, rotation=motion.rotation @ turns)


def _turned_at(place: int, turn: Array) -> Callable[[Motion], Motion]:
    def undo(motion: Motion) -> Motion:
        rotation = motion.rotation.copy()
        rotation[:, place] = rotation[:, place] @ turn
        return replace(motion, rotation=rotation)

    return undo


def _quarter_turns() -> list[Array]:
    """The 23 turns of a cube, the identity left out."""
    turns = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) > 0 and not np.array_equal(turn, np.eye(3)):
                turns.append(turn)
    return turns


def _turn_name(turn: Array, mirror: Array) -> str:
    own = turn * mirror[:, None] * mirror
    degrees = round(float(np.degrees(np.arccos(np.clip((np.trace(own) - 1) / 2, -1, 1)))))
    if degrees == 180:
        axis = np.linalg.eigh(own + own.T)[1][:, -1]
    else:
        axis = np.array([own[2, 1] - own[1, 2], own[0, 2] - own[2, 0], own[1, 0] - own[0, 1]])
    along = np.flatnonzero(np.abs(axis) > 0.3)
    if len(along) == 1:
        sign = "-" if axis[along[0]] < 0 and degrees != 180 else ""
        return f"{sign}{degrees} deg about its {'xyz'[along[0]]} axis"
    return f"{degrees} deg about a diagonal"
