"""Play keys: somebody's fingers go down on one level, stop there, and come up again.

Written for this drawing alone: from its own words for joints, with its own course of a stroke.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.other_hands.carriage import carry, placed
from benchmarks.other_hands.person import DIGITS, FINGERS, Array, Person

KEY_TRAVEL_MM, STOPS_S = 11.0, 0.003


@dataclass(frozen=True)
class Press:
    """A key pressed: from when the finger goes down, when it is at the bottom and when it leaves it."""

    digit: str
    from_s: float
    bottom_s: float
    leaves_s: float


def press_keys(
    person: Person, rng: np.random.Generator, time_s: Array, every_s: float, drags: float
) -> tuple[dict[str, Array], list[Press]]:
    """Give each joint's angles, (T, D) degrees, and what was pressed.

    every_s : from one key to the next; drags : by how much a finger takes the next one along.
    """
    names = [angle for joint in person.joints for angle in joint.angles]
    home = dict.fromkeys(names, 0.0) | {"wrist.bend": -10.0, "thumb_cmc.sway": 6.0, "thumb_mcp.bend": 8.0}
    for finger in FINGERS:
        home |= {f"{finger}_mcp.bend": 22.0, f"{finger}_pip.bend": 30.0, f"{finger}_dip.bend": 14.0}
    moves = {finger: {f"{finger}_mcp.bend": 1.0, f"{finger}_pip.bend": 0.12} for finger in FINGERS}
    moves["thumb"] = {"thumb_cmc.sway": 0.5, "thumb_cmc.bend": 0.3, "thumb_mcp.bend": 0.2}
    level_mm = float(np.mean([_height(person, home, moves[d], 0.0, d) for d in DIGITS])) - 4.0
    levels = {above: _reach(person, home, moves, level_mm + above) for above in (0.0, KEY_TRAVEL_MM, 20.0)}
    own, presses = np.zeros((len(time_s), len(DIGITS))), list[Press]()
    at_s, last = 1.0, -1
    while at_s < time_s[-1] - 1.0:
        struck = int(rng.choice([i for i in range(5) if i != last]))
        falls_s, held_s = min(0.10, 0.38 * every_s) * rng.uniform(0.9, 1.1), min(0.22, 0.55 * every_s)
        high = rng.uniform(0.3, 1.0)
        rest, bottom, top = (levels[above][struck] for above in (KEY_TRAVEL_MM, 0.0, 20.0))
        own[:, struck] += _course(time_s - at_s, falls_s, held_s, high * (top - rest), bottom - rest)
        presses.append(Press(DIGITS[struck], at_s - falls_s, at_s, at_s + held_s))
        at_s, last = at_s + every_s * rng.uniform(0.9, 1.1), struck
    apart = np.abs(np.arange(5)[:, None] - np.arange(5))
    takes = np.where(
        (apart > 0) & (np.arange(5) > 0) & (np.arange(5)[:, None] > 0), drags / apart.clip(1) ** 2, 0
    )
    bend = own + own @ takes + levels[KEY_TRAVEL_MM]
    track = {name: np.full(len(time_s), deg) for name, deg in home.items()}
    for column, digit in enumerate(DIGITS):
        for name, share in moves[digit].items():
            track[name] = track[name] + share * bend[:, column]
    angles = {joint.name: np.column_stack([track[name] for name in joint.angles]) for joint in person.joints}
    return angles, presses


def _course(off_s: Array, falls_s: float, held_s: float, high: float, low: float) -> Array:
    """A finger that is raised, falls faster and faster, is stopped within STOPS_S, held and let go."""
    raised = high * (1 - np.cos(np.pi * np.clip(off_s / falls_s + 2, 0, 1))) / 2
    falls = (low - high) * (1 - np.cos(np.pi / 2 * np.clip(off_s / falls_s + 1, 0, 1)))
    gives = np.pi / 2 * (low - high) / falls_s
    after = np.clip(off_s, 0, STOPS_S)
    down = raised + falls + gives * (after - after**2 / 2 / STOPS_S)
    return np.asarray(down * (1 + np.cos(np.pi * np.clip((off_s - held_s) / 0.09, 0, 1))) / 2)


def _height(
    person: Person, home: dict[str, float], moves: dict[str, float], amount: float, digit: str
) -> float:
    """How high a fingertip is over the wrist in a posture, mm."""
    posture = home | {name: home[name] + share * amount for name, share in moves.items()}
    angles = {joint.name: np.array([[posture[name] for name in joint.angles]]) for joint in person.joints}
    bones, _ = carry(person, angles)
    return float(placed(bones[f"{digit}_distal"], person.bones[f"{digit}_distal"].end)[0, 2])


def _reach(
    person: Person, home: dict[str, float], moves: dict[str, dict[str, float]], height_mm: float
) -> Array:
    """How far each digit must move for its tip to be so high, (5,) degrees."""
    found = []
    for digit in DIGITS:
        low, high = -40.0, 60.0
        for _ in range(30):
            middle = (low + high) / 2
            above = _height(person, home, moves[digit], middle, digit) > height_mm
            low, high = (middle, high) if above else (low, middle)
        found.append(low)
    return np.array(found)
