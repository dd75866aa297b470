"""What joints are called elsewhere: tables from a hand's joints to the names of other rigs.

WebXR Hand Input has 25 names. VRM 1.0, Unity's HumanBodyBones and Mixamo
have no metacarpals for the fingers; Unreal's mannequin has (Unreal Engine 5). Where a rig names no tips,
they are called after the last bone, with `_end`. The tips of WebXR are at the skin's surface, those of the
others end the last bone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

FINGERS = ("index", "middle", "ring", "little")
_FINGER = ("cmc", "mcp", "pip", "dip", "tip")
_THUMB = ("cmc", "mcp", "ip", "tip")


@dataclass(frozen=True)
class Rig:
    """A rig's names of a hand's joints.

    root, thumb (4), finger (5) : of the root and of the joints from a digit's base to its tip; empty where
    the rig has no such joint. In them {side} is right or left, {s} its first letter, {digit} a finger, or
    {pinky} where the little one is called so; {Side}, {Digit}, {Pinky} in such letters. Finger metacarpals
    that it lacks are folded into the bones after them (`stages.export.rigging`). skin_tips : whether its tips
    are on the skin; else they are the ends of the last bones.
    """

    description: str
    root: str
    thumb: Sequence[str]
    finger: Sequence[str]
    skin_tips: bool = False

    def names(self, hand: str) -> dict[str, str]:
        """Names of a right or left hand's joints by joint, the root's by ""."""
        patterns = {"": ("", self.root)}
        patterns |= {f"thumb_{part}": ("thumb", own) for part, own in zip(_THUMB, self.thumb, strict=True)}
        for digit in FINGERS:
            patterns |= {
                f"{digit}_{part}": (digit, own) for part, own in zip(_FINGER, self.finger, strict=True)
            }
        side = {"side": hand, "Side": hand.capitalize(), "s": hand[0]}
        names = {}
        for joint, (digit, pattern) in patterns.items():
            pinky = "pinky" if digit == "little" else digit
            capitals = {"Digit": digit.capitalize(), "Pinky": pinky.capitalize()}
            if pattern:
                names[joint] = pattern.format(**side, **capitals, digit=digit, pinky=pinky)
        return names


_WEB_FINGER = ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
_VRM_THUMB = ("Metacarpal", "Proximal", "Distal", "Distal_end")
_PHALANGES = ("Proximal", "Intermediate", "Distal", "Distal_end")
_UNREAL = ("01_{s}", "02_{s}", "03_{s}", "03_{s}_end")
_MIXAMO = "mixamorig:{Side}Hand"

RIGS: Mapping[str, Rig] = {
    "webxr": Rig(
        "WebXR Hand Input, 25 joints",
        "wrist",
        ("thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip"),
        [f"{{pinky}}-finger-{bone}" for bone in _WEB_FINGER],
        skin_tips=True,
    ),
    "vrm": Rig(
        "VRM 1.0 humanoid, no finger metacarpals",
        "{side}Hand",
        [f"{{side}}Thumb{bone}" for bone in _VRM_THUMB],
        ["", *(f"{{side}}{{Digit}}{bone}" for bone in _PHALANGES)],
    ),
    "unity": Rig(
        "Unity HumanBodyBones, no finger metacarpals",
        "{Side}Hand",
        [f"{{Side}}Thumb{bone}" for bone in _PHALANGES],
        ["", *(f"{{Side}}{{Digit}}{bone}" for bone in _PHALANGES)],
    ),
    "unreal": Rig(
        "Unreal Engine 5 mannequin",
        "hand_{s}",
        [f"thumb_{bone}" for bone in _UNREAL],
        ["{pinky}_metacarpal_{s}", *(f"{{pinky}}_{bone}" for bone in _UNREAL)],
    ),
    "mixamo": Rig(
        "Mixamo, no finger metacarpals",
        _MIXAMO,
        [f"{_MIXAMO}Thumb{number}" for number in (1, 2, 3, 4)],
        ["", *(f"{_MIXAMO}{{Pinky}}{number}" for number in (1, 2, 3, 4))],
    ),
}


def ascii_name(name: str) -> str:
    """The name in letters, digits and `_ - : .` of ASCII only, for formats that know no quotes.

    Any other character becomes its code, so that two names never become one in practice.
    """
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-:.") else f"_u{ord(c):04x}" for c in name)


def plain_names(names: Iterable[str]) -> list[str]:
    """Names of letters, digits and underscores, no two the same; all that XML, OpenSim and scripts take."""
    taken: list[str] = []
    for original in names:
        name = plain = re.sub(r"\W", "_", ascii_name(original), flags=re.ASCII)
        number = 2
        while name in taken:
            name, number = f"{plain}_{number}", number + 1
        taken.append(name)
    return taken
