"""Hold the movements that can be asked for: what moves, how far, and the seconds that it takes.

A posture gives joints (flexion, abduction) in degrees from the straight digit that lies flat; joints that it
does not name are as in the relaxed hand. The ranges are those that docs/calibration-movements.md asks for;
healthy joints have more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

FINGERS = ("index", "middle", "ring", "little")
Posture = Mapping[str, tuple[float, float]]

RELAXED_DEG = {"mcp": 15.0, "pip": 20.0, "dip": 10.0, "ip": 8.0}
"""Flexion of the relaxed hand's joints, by kind."""


@dataclass(frozen=True)
class Movement:
    """One movement. postures : gone through in turn, there and back. seconds : for doing it twice.

    shown : joint to the flexion or abduction range in degrees by which it is seen to be done.
    """

    name: str
    postures: tuple[Posture, ...]
    shown: Mapping[tuple[str, str], float]
    seconds: float

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints that it is for, in its own order."""
        return tuple(dict.fromkeys(joint for joint, _ in self.shown))


def _bent(fingers: list[str], **deg: float) -> dict[str, tuple[float, float]]:
    return {f"{finger}_{kind}": (own, 0.0) for finger in fingers for kind, own in deg.items()}


def _shown(fingers: list[str], axis: str = "flexion", **deg: float) -> dict[tuple[str, str], float]:
    return {(f"{finger}_{kind}", axis): own for finger in fingers for kind, own in deg.items()}


_SPREAD_DEG = {"index": 14.0, "middle": 4.0, "ring": -9.0, "little": -16.0}


def _free() -> Movement:
    """Every finger and the thumb its own way, at once: says most in least time, but of no joint all that it
    can.
    """
    postures = []
    for step in range(12):
        posture: dict[str, tuple[float, float]] = {}
        for number, finger in enumerate(FINGERS):
            bend, curl, sway = (
                0.5 - 0.5 * math.cos(step * pace + number * later)
                for pace, later in ((1.9, 1.7), (2.7, 1.1), (1.3, 2.3))
            )
            posture |= {
                f"{finger}_mcp": (60 * bend, 14 * sway - 7),
                f"{finger}_pip": (70 * curl, 0.0),
                f"{finger}_dip": (40 * curl, 0.0),
            }
        round_it = 1.1 * step
        posture["thumb_cmc"] = (4 + 18 * math.cos(round_it), 14 * math.sin(round_it))
        posture["thumb_mcp"] = (22 - 22 * math.cos(1.7 * step), 0.0)
        posture["thumb_ip"] = (28 - 28 * math.cos(2.3 * step), 0.0)
        posture["little_cmc"] = (6 - 6 * math.cos(0.9 * step), 0.0)
        postures.append(posture)
    shown = _shown(list(FINGERS), mcp=25.0, pip=30.0) | {
        ("thumb_cmc", "flexion"): 12.0,
        ("thumb_mcp", "flexion"): 12.0,
    }
    return Movement("free", tuple(postures), shown, 6.0)


def _of_fingers() -> list[Movement]:
    fingers = list(FINGERS)
    flat = _bent(fingers, mcp=0.0, pip=2.0, dip=0.0)
    back = flat | _bent(fingers, mcp=-15.0)
    spread = flat | {f"{finger}_mcp": (0.0, _SPREAD_DEG[finger]) for finger in fingers}
    closed = flat | {f"{finger}_mcp": (0.0, -0.25 * _SPREAD_DEG[finger]) for finger in fingers}
    wide = {
        (f"{finger}_mcp", "abduction"): 0.7 * abs(_SPREAD_DEG[finger])
        for finger in fingers
        if finger != "middle"
    }
    tips = [
        Movement(
            f"fingertip-{finger}", (flat, flat | _bent([finger], dip=45.0)), _shown([finger], dip=30.0), 4.0
        )
        for finger in fingers
    ]
    alone = [
        Movement(
            f"alone-{finger}",
            (flat, flat | _bent([finger], mcp=60.0, pip=70.0, dip=40.0)),
            _shown([finger], mcp=40.0),
            4.0,
        )
        for finger in fingers
    ]
    return [
        Movement(
            "fist",
            (flat, _bent(fingers, mcp=65.0, pip=80.0, dip=50.0)),
            _shown(fingers, mcp=45.0, pip=55.0),
            5.0,
        ),
        Movement(
            "hook",
            (flat, flat | _bent(fingers, pip=80.0, dip=50.0)),
            _shown(fingers, pip=50.0, dip=30.0),
            5.0,
        ),
        Movement("knuckles", (back, flat | _bent(fingers, mcp=65.0)), _shown(fingers, mcp=50.0), 5.0),
        Movement("spread", (closed, spread), wide, 5.0),
        *tips,
        *alone,
    ]


def _of_thumb() -> list[Movement]:
    circle = [
        (26.0, 0.0),
        (18.0, 14.0),
        (0.0, 20.0),
        (-14.0, 12.0),
        (-18.0, 0.0),
        (-10.0, -12.0),
        (6.0, -16.0),
        (20.0, -10.0),
    ]
    return [
        Movement(
            "thumb-circle",
            tuple({"thumb_cmc": deg} for deg in circle),
            {("thumb_cmc", "flexion"): 25.0, ("thumb_cmc", "abduction"): 18.0},
            6.0,
        ),
        Movement(
            "thumb-middle",
            ({"thumb_mcp": (0.0, 0.0)}, {"thumb_mcp": (48.0, 0.0)}),
            {("thumb_mcp", "flexion"): 30.0},
            4.0,
        ),
        Movement(
            "thumb-tip",
            ({"thumb_ip": (-5.0, 0.0)}, {"thumb_ip": (60.0, 0.0)}),
            {("thumb_ip", "flexion"): 35.0},
            4.0,
        ),
    ]


def _of_all() -> list[Movement]:
    fingers = list(FINGERS)
    open_hand = _bent(fingers, mcp=5.0, pip=10.0, dip=5.0)
    open_hand |= {"thumb_cmc": (-6.0, 6.0), "thumb_mcp": (5.0, 0.0), "thumb_ip": (5.0, 0.0)}
    cup = _bent(fingers, mcp=40.0, pip=40.0, dip=20.0) | {
        "ring_cmc": (10.0, 0.0),
        "little_cmc": (18.0, 0.0),
        "thumb_cmc": (22.0, -8.0),
    }
    meeting = {"thumb_cmc": (20.0, 0.0), "thumb_mcp": (22.0, 0.0), "thumb_ip": (25.0, 0.0)}
    pads = [
        open_hand
        | meeting
        | _bent([finger], mcp=50.0, pip=48.0, dip=25.0)
        | {"little_cmc": (5.0 * number, 0.0)}
        for number, finger in enumerate(fingers)
    ]
    back = [open_hand] * len(pads)
    return [
        Movement(
            "cup", (open_hand, cup), {("little_mcp", "flexion"): 20.0, ("thumb_cmc", "flexion"): 15.0}, 5.0
        ),
        Movement(
            "opposition",
            tuple(posture for pair in zip(pads, back, strict=True) for posture in pair),
            {("thumb_cmc", "flexion"): 15.0, ("thumb_ip", "flexion"): 10.0, ("little_mcp", "flexion"): 25.0},
            8.0,
        ),
    ]


MOVEMENTS: Mapping[str, Movement] = {
    own.name: own for own in (_free(), *_of_fingers(), *_of_thumb(), *_of_all())
}
"""All of them by name, in the protocol's order; the order settles ties."""
