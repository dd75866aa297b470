"""Movements of a calibration: those of the simulator's range of motion, and what is asked for beside them.

A movement goes through postures, (J, 2) flexion and abduction in degrees, in a loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from guide.average_joints import average_joints
from skeleton.rotations import Array
from stages.simulate.contact import contact_postures
from stages.simulate.random_hand import FINGERS, FLEXION, JOINTS
from stages.simulate.realism import Realism
from stages.simulate.task_motion import minimum_jerk, posture, range_postures, rest_posture

Direction = tuple[float, float, float]

BACK: Direction = (0.0, 0.0, 1.0)
PALM: Direction = (0.0, 0.0, -1.0)
THUMB_SIDE: Direction = (0.0, 1.0, 0.0)

_STEPS, _HELD = 4, 1
_STEP_S = 0.24
_GIVES_WAY_DEG = 8.0
"""A DIP joint when the pad is pressed: within what the simulator's do."""

_TOGETHER = 0.3
"""Of the simulator's closed fingers: all the way they would cross, whose flesh is not in its way."""

_APART = 0.4
"""Of the simulator's spread by which fingers stand apart, so that none hides another."""


@dataclass(frozen=True)
class Movement:
    """A movement and how to look at it.

    postures : (K, J, 2), gone through in a loop; the first is what a still picture shows. towards : from
    where each of its views is seen; seen : their names among the labels. joints : that it is for.
    """

    name: str
    postures: Array
    joints: tuple[str, ...]
    seen: tuple[str, ...]
    towards: tuple[Direction, ...]

    @property
    def moves(self) -> bool:
        """Whether there is more than one posture."""
        return len(self.postures) > 1

    @property
    def frames(self) -> Array:
        """Postures (T, J, 2) of the loop, evenly in time, from one to the next with minimum jerk."""
        if not self.moves:
            return self.postures
        closed = np.concatenate([self.postures, self.postures[:1]])
        times = np.arange(len(closed), dtype=float) * (_STEPS + _HELD)
        way = closed.repeat(2, axis=0)[:-1]  # held for a while, then on to the next
        held = np.stack([times, times + _HELD], 1).ravel()[:-1]
        return minimum_jerk(held, way, np.arange(times[-1]))

    @property
    def seconds(self) -> float:
        """Of one loop."""
        return len(self.frames) * _STEP_S if self.moves else 0.0

    def ranges_deg(self) -> dict[str, Array]:
        """Ranges of flexion and abduction (2,) of the joints that it is for."""
        spans = np.ptp(self.frames, axis=0)
        return {joint: spans[JOINTS.index(joint)] for joint in self.joints}


def _of(kind: str, digits: Sequence[str] = FINGERS) -> tuple[str, ...]:
    return tuple(f"{digit}_{kind}" for digit in digits)


@cache
def movements() -> dict[str, Movement]:
    """All movements, in the order in which a subject makes them."""
    ranges = {name: np.array(poses) for name, poses in range_postures().items()}
    apart = _APART * ranges["spread"][0]
    rest = rest_posture() + apart
    flat = apart + posture(thumb_cmc=(2.0, 4.0))
    fingers, thumb = (*_of("mcp"), *_of("pip"), *_of("dip")), ("thumb_cmc", "thumb_mcp", "thumb_ip")
    half = 0.5 * rest_posture()
    wrist = ranges["wrist-bend"], ranges["wrist-sideways"]
    made = [
        Movement("flat", flat[None], (), ("from-back", "from-thumb"), (BACK, THUMB_SIDE)),
        _seen_from_thumb("knuckles", [rest + ranges["knuckles"][0], rest + ranges["back"][0]], _of("mcp")),
        _seen_from_thumb("hook", [rest + ranges["hook"][0], rest], (*_of("pip"), *_of("dip"))),
        _seen_from_thumb("fingertips", _fingertips(rest), _of("dip")),
        _seen_from_palm("fist", [rest + ranges["fist"][0], rest], fingers),
        _seen_from_palm("alone", _each_and_rest(rest, ranges["alone"]), fingers),
        _seen_from_back(
            "spread", [half + ranges["spread"][0], half + _TOGETHER * ranges["spread"][1]], _of("mcp")
        ),
        _seen_from_palm("thumb-circle", list(rest + ranges["thumb-circle"]), ("thumb_cmc",)),
        _seen_from_palm(
            "thumb-bend", _each_and_rest(rest, ranges["thumb-bend"][:2]), ("thumb_mcp", "thumb_ip")
        ),
        _seen_from_palm("opposition", _touches(rest), (*thumb, *_of("mcp"), *_of("pip"))),
        _seen_from_palm("cup", [rest + ranges["grasp"][0], rest], _of("cmc", ("ring", "little"))),
        _seen_from_thumb("wrist-bend", list(rest + wrist[0]), ("wrist",)),
        _seen_from_back("wrist-sideways", list(rest + wrist[1]), ("wrist",)),
    ]
    return {movement.name: movement for movement in made}


def _seen_from_back(name: str, postures: Sequence[Array], joints: tuple[str, ...]) -> Movement:
    return Movement(name, np.array(postures), joints, ("from-back",), (BACK,))


def _seen_from_palm(name: str, postures: Sequence[Array], joints: tuple[str, ...]) -> Movement:
    return Movement(name, np.array(postures), joints, ("from-palm",), (PALM,))


def _seen_from_thumb(name: str, postures: Sequence[Array], joints: tuple[str, ...]) -> Movement:
    return Movement(name, np.array(postures), joints, ("from-thumb",), (THUMB_SIDE,))


def _fingertips(rest: Array) -> list[Array]:
    """Fingertip joints alone, from straight to bent, as a hand does that another one holds."""
    held = rest + posture(**dict.fromkeys(_of("pip"), 20.0))
    bent, straight = held.copy(), held.copy()
    tips = [JOINTS.index(joint) for joint in _of("dip")]
    bent[tips, FLEXION], straight[tips, FLEXION] = 50.0, 0.0
    return [bent, straight]


def _each_and_rest(rest: Array, poses: Array) -> list[Array]:
    return [each for pose in poses for each in (rest + pose, rest)]


def _touches(rest: Array) -> list[Array]:
    """The thumb's pad on that of each finger in turn, the palm cupped towards the little finger."""
    cup = np.array(range_postures()["cup"][0])
    cup[[JOINTS.index(joint) for joint in _of("cmc", ("index", "middle"))]] = 0.0  # not to be seen
    starts = np.array([rest + share * cup for share in (0.0, 0.0, 0.7, 1.0)])
    dips = [JOINTS.index(joint) for joint in _of("dip")]
    starts[:, dips, FLEXION] += _GIVES_WAY_DEG * np.eye(len(FINGERS))
    met = contact_postures(average_joints(), starts, Realism.full())
    return _each_and_rest(rest, met - rest)
