"""What joints are called elsewhere: tables from a hand's joints to the names of other rigs.

WebXR Hand Input has 25 names, OpenXR the same joints and a palm. VRM 1.0, Unity's HumanBodyBones and Mixamo
have no metacarpals for the fingers; Unreal's mannequin has (Unreal Engine 5). Where a rig names no tips,
they are called after the last bone, with `_end`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

FINGERS = ("index", "middle", "ring", "little")
_BONES = ("cmc", "mcp", "pip", "dip", "tip")
_THUMB = ("cmc", "mcp", "ip", "tip")


@dataclass(frozen=True)
class Rig:
    """A rig's names of a hand's joints.

    names : from hand (right or left) to its names by joint, the root's by "". palm : what the rig calls the
    middle of the palm, empty where it has no such joint. Finger metacarpals that it does not name are folded
    into the bones after them (`stages.export.rigging`).
    """

    description: str
    names: Callable[[str], Mapping[str, str]]
    palm: str = ""


def _joints(root: str, name: Callable[[str, str, int], str]) -> dict[str, str]:
    """Names by joint; name(digit, part, number from 0 at the digit's base); an empty one: not in the rig."""
    found = {"": root}
    for digit in ("thumb", *FINGERS):
        for number, part in enumerate(_THUMB if digit == "thumb" else _BONES):
            found[f"{digit}_{part}"] = name(digit, part, number)
    return {joint: word for joint, word in found.items() if word}


def _webxr(hand: str) -> dict[str, str]:
    del hand  # an XRHand has a handedness, its joints' names have none
    thumb = ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip")
    finger = ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")

    def name(digit: str, part: str, number: int) -> str:
        del part
        if digit == "thumb":
            return f"thumb-{thumb[number]}"
        return f"{'pinky' if digit == 'little' else digit}-finger-{finger[number]}"

    return _joints("wrist", name)


def _openxr(hand: str) -> dict[str, str]:
    del hand  # as in WebXR
    thumb = ("METACARPAL", "PROXIMAL", "DISTAL", "TIP")
    finger = ("METACARPAL", "PROXIMAL", "INTERMEDIATE", "DISTAL", "TIP")

    def name(digit: str, part: str, number: int) -> str:
        del part
        word = (thumb if digit == "thumb" else finger)[number]
        return f"XR_HAND_JOINT_{digit.upper()}_{word}_EXT"

    return _joints("XR_HAND_JOINT_WRIST_EXT", name)


def _vrm(hand: str) -> dict[str, str]:
    thumb, finger = ("Metacarpal", "Proximal", "Distal"), ("", "Proximal", "Intermediate", "Distal")
    return _humanoid(hand, thumb, finger)


def _unity(hand: str) -> dict[str, str]:
    thumb, finger = ("Proximal", "Intermediate", "Distal"), ("", "Proximal", "Intermediate", "Distal")
    return _humanoid(hand.capitalize(), thumb, finger)


def _humanoid(side: str, thumb: tuple[str, ...], finger: tuple[str, ...]) -> dict[str, str]:
    def name(digit: str, part: str, number: int) -> str:
        words = thumb if digit == "thumb" else finger
        if part == "tip":
            return f"{side}{digit.capitalize()}{words[-1]}_end"
        return f"{side}{digit.capitalize()}{words[number]}" if words[number] else ""

    return _joints(f"{side}Hand", name)


def _unreal(hand: str) -> dict[str, str]:
    side = hand[0]

    def name(digit: str, part: str, number: int) -> str:
        stem = "pinky" if digit == "little" else digit
        if part == "tip":
            return f"{stem}_03_{side}_end"
        if digit == "thumb":
            return f"{stem}_{number + 1:02}_{side}"
        return f"{stem}_metacarpal_{side}" if number == 0 else f"{stem}_{number:02}_{side}"

    return _joints(f"hand_{side}", name)


def _mixamo(hand: str) -> dict[str, str]:
    stem = f"mixamorig:{hand.capitalize()}Hand"

    def name(digit: str, part: str, number: int) -> str:
        del part
        word = "Pinky" if digit == "little" else digit.capitalize()
        if digit == "thumb":
            return f"{stem}{word}{number + 1}"
        return f"{stem}{word}{number}" if number else ""

    return _joints(stem, name)


RIGS: Mapping[str, Rig] = {
    "webxr": Rig("WebXR Hand Input, 25 joints", _webxr),
    "openxr": Rig("OpenXR XR_EXT_hand_tracking, 26 joints with the palm", _openxr, "XR_HAND_JOINT_PALM_EXT"),
    "vrm": Rig("VRM 1.0 humanoid, no finger metacarpals", _vrm),
    "unity": Rig("Unity HumanBodyBones, no finger metacarpals", _unity),
    "unreal": Rig("Unreal Engine 5 mannequin", _unreal),
    "mixamo": Rig("Mixamo, no finger metacarpals", _mixamo),
}


def ascii_name(name: str) -> str:
    """The name in letters, digits and `_ - : .` of ASCII only, for formats that know no quotes.

    Any other character becomes its code, so that two names never become one in practice.
    """
    return "".join(c if c.isascii() and (c.isalnum() or c in "_-:.") else f"_u{ord(c):04x}" for c in name)
