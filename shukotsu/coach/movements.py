"""The movements that can be asked for: what to do, the joints that it tells of, the seconds that it takes.

The ranges are those that docs/calibrate.md asks for; healthy joints have more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

FINGERS = ("index", "middle", "ring", "little")
FIRST = "free"
"""The movement that is asked for before anything is estimated: it says most in least time."""


@dataclass(frozen=True)
class Movement:
    """One movement. range_deg : by joint, how far it bends where that is done; seconds : for doing it
    twice.
    """

    name: str
    sentence: str
    range_deg: Mapping[str, float]
    seconds: float = 5.0


def _bent(fingers: tuple[str, ...] = FINGERS, **range_deg: float) -> dict[str, float]:
    return {f"{finger}_{kind}": deg for finger in fingers for kind, deg in range_deg.items()}


_ALL = (
    Movement(
        FIRST,
        "Move every finger and the thumb, each its own way, widely: bend, stretch and spread.",
        _bent(mcp=25, pip=30, dip=15) | {"thumb_cmc": 12, "thumb_mcp": 12, "thumb_ip": 12},
        6.0,
    ),
    Movement("fist", "Close the hand to a fist and open it wide, twice.", _bent(mcp=45, pip=55, dip=30)),
    Movement(
        "hook",
        "Keep the knuckles straight; bend the fingers to a hook and stretch them, twice.",
        _bent(pip=50, dip=30),
    ),
    Movement(
        "knuckles",
        "Keep the fingers straight; bend them at the knuckles, then draw them back, twice.",
        _bent(mcp=50),
    ),
    Movement("spread", "Keep the fingers straight; spread them apart and close them, twice.", _bent(mcp=10)),
    *(
        Movement(
            f"fingertip-{finger}",
            f"Bend the {finger} fingertip alone; hold the middle joint with the other hand.",
            _bent((finger,), dip=30),
            4.0,
        )
        for finger in FINGERS
    ),
    *(
        Movement(
            f"alone-{finger}",
            f"Bend the {finger} finger alone, all of it, and stretch it, twice.",
            _bent((finger,), mcp=40, pip=45, dip=25),
            4.0,
        )
        for finger in FINGERS
    ),
    Movement(
        "thumb-circle",
        "Draw a large circle with the thumb, from its base, both ways.",
        {"thumb_cmc": 25},
        6.0,
    ),
    Movement(
        "thumb-middle",
        "Bend the thumb at its middle joint alone, and stretch it, twice.",
        {"thumb_mcp": 30},
        4.0,
    ),
    Movement(
        "thumb-tip",
        "Bend the thumb's tip joint alone; hold the bone before it with the other hand.",
        {"thumb_ip": 35},
        4.0,
    ),
)
MOVEMENTS: Mapping[str, Movement] = {movement.name: movement for movement in _ALL}
"""All of them by name; the order settles ties."""
