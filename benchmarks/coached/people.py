"""Simulated people of both drawings who do one movement after another, as somebody asks them to.

Each movement is a recording of its own, of the same bones, skin and receivers; what a coach sees are these
put one behind the other.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from benchmarks import other_hands
from benchmarks.faultless_hands import FACINGS, true_halves
from benchmarks.other_hands.carriage import touching
from benchmarks.other_hands.gestures import rounded, wander
from benchmarks.two_drawings import OTHER, OWN
from shukotsu.anatomy.drawn_hands import MIXED_TABLE
from shukotsu.coach.movements import FINGERS
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.simulate.contact import contact_postures
from shukotsu.stages.simulate.forward import coupled_angles
from shukotsu.stages.simulate.random_hand import JOINTS, hand_of
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate
from shukotsu.stages.simulate.task_motion import Motion, rest_posture

RATE_HZ, SUBJECT, ROUNDED_S = 240, "01", 0.25
OWN_REACH, FREE_KNOTS, DIGITS = 0.95, 60, ("thumb", *FINGERS)
ROUTINE, REST, FREE = "routine", "rest", "free"
"""What a standard calibration goes through; nothing; every digit its own way, as people talk, too."""

CIRCLE, OPPOSITION = "thumb-circle", "opposition"
Posture = dict[str, float]


@dataclass(frozen=True)
class Performed:
    """Poses of one movement, and by joint its true centre (2, 3) in the two receivers, mm, as they rode."""

    poses: Poses
    halves: Mapping[str, Array]


@dataclass
class Person(ABC):
    """Somebody who wears receivers. rest : degrees of all angles, by JOINT.bend and JOINT.sway, at rest.

    reach : share of the usual range; tip_share : how far a fingertip goes along with the middle joint.
    """

    seed: int
    hand: str
    rest: Posture
    reach: float
    tip_share: float

    def perform(self, movement: str, seconds: float, reach: float = 1.0, turn: int = 0) -> Performed:
        """Do a movement; reach : share of this person's range. turn : no two movements are alike."""
        rng = np.random.default_rng([self.seed, turn])
        track = None if movement == ROUTINE else self._track(movement, seconds, reach * self.reach, rng)
        return self._recorded(track, seconds, turn)

    def _track(self, movement: str, seconds: float, reach: float, rng: np.random.Generator) -> Array:
        """Degrees (T, A) of all angles."""
        time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
        if movement == FREE:
            knots, pace = self._free(seconds, rng), np.ones(FREE_KNOTS - 1)
        else:
            knots = self._script(movement, rng)
            pace = rng.uniform(0.8, 1.2, len(knots) - 1)
        at_s = np.append(0.0, pace.cumsum()) / pace.sum() * seconds
        rest = np.array(list(self.rest.values()))
        far = rest + reach * (np.array([[knot[name] for name in self.rest] for knot in knots]) - rest)
        track = rounded(np.column_stack([np.interp(time_s, at_s, own) for own in far.T]), time_s, ROUNDED_S)
        tremor = 0.5 * wander(rng, time_s, len(rest), (0.2, 1.5))
        return np.asarray(track + tremor * [0.3 if "_cmc" in name else 1.0 for name in self.rest])

    def _script(self, movement: str, rng: np.random.Generator) -> list[Posture]:
        """Postures from rest to rest; twice, but round after round, or finger after finger."""
        script = [self.rest]
        for target in self._targets(movement):
            amount = rng.uniform(0.9, 1.05)
            reached = {name: deg + amount * (target[name] - deg) for name, deg in self.rest.items()}
            script += [reached, reached] if movement == OPPOSITION else [reached]
            script += [] if movement == CIRCLE else [self.rest]
        return [*script, *(script[1:] if movement not in (CIRCLE, OPPOSITION) else []), self.rest]

    def _targets(self, movement: str) -> list[Posture]:
        """Postures that a movement goes to."""
        if movement == OPPOSITION:
            return self._meetings()
        if movement == CIRCLE:
            return [self.rest | _thumb(step) for step in np.linspace(0, 4 * np.pi, 25).tolist()]
        name, _, finger = movement.partition("-")
        targets = []
        for bent, more in _DEG[movement if name == "thumb" else name]:
            deg = dict(zip(("mcp", "pip", "dip"), bent, strict=False))
            deg |= {"dip": self.tip_share * deg["pip"]} if len(deg) == 2 else {}
            fingers = (finger,) if finger else FINGERS
            bends = {f"{own}_{kind}.bend": bend for own in fingers for kind, bend in deg.items()}
            targets.append(self.rest | bends | more)
        return targets

    def _free(self, seconds: float, rng: np.random.Generator) -> list[Posture]:
        """Postures of every digit moving its own way, widely."""
        at, kinds = np.linspace(0, seconds, FREE_KNOTS), ("mcp", "pip", "sway", "cmc")
        pace = {own: rng.uniform(1.0, 2.2) for own in product(DIGITS, kinds)}
        phase = {own: rng.uniform(0, 2 * np.pi) + 2 * np.pi / every_s * at for own, every_s in pace.items()}
        knots = [dict(self.rest) for _ in at]
        for name in self.rest:
            digit, _, angle = name.partition("_")
            if angle in _FREE_DEG:
                low, high, bend = _FREE_DEG[angle]
                for knot, turn in zip(knots, phase[digit, bend], strict=True):
                    knot[name] = low + (high - low) * (0.5 - 0.5 * np.cos(turn))
        return [knot | _thumb(turn) for knot, turn in zip(knots, phase["thumb", "cmc"], strict=True)]

    @abstractmethod
    def _meetings(self) -> list[Posture]:
        """Postures in which the thumb's pad is on each finger's in turn."""

    @abstractmethod
    def _recorded(self, track: Array | None, seconds: float, turn: int) -> Performed:
        """Record these angles (T, A), or the routine."""


def _thumb(turn: float) -> Posture:
    """A thumb on its circle: it reaches no corners."""
    return {"thumb_cmc.bend": 7 + 24 * float(np.cos(turn)), "thumb_cmc.sway": 4 + 21 * float(np.sin(turn))}


_FREE_DEG = {
    "mcp.bend": (0, 60, "mcp"),
    "mcp.sway": (-8, 8, "sway"),
    "pip.bend": (5, 76, "pip"),
    "dip.bend": (0, 50, "pip"),
    "ip.bend": (0, 59, "pip"),
}
"""What angles go through, and with what."""

_SWAY_DEG = zip(FINGERS, (16.0, 4.0, -11.0, -20.0), strict=True)
_SPREAD_DEG: Posture = {f"{finger}_mcp.sway": deg for finger, deg in _SWAY_DEG}
_CUP_DEG: Posture = {"thumb_cmc.bend": 22, "thumb_cmc.sway": 10, "ring_cmc.bend": 12, "little_cmc.bend": 22}
_DEG: Mapping[str, Sequence[tuple[Sequence[float], Posture]]] = {
    REST: (),
    "fist": (((80, 90), {"ring_cmc.bend": 7, "little_cmc.bend": 13}),),
    "hook": (((2, 92), {}),),
    "knuckles": (((78, 6), {}), ((-14, 4), {})),
    "spread": (
        ((), _SPREAD_DEG | {"thumb_cmc.bend": -18, "thumb_cmc.sway": -8}),
        ((), {name: -0.25 * deg for name, deg in _SPREAD_DEG.items()}),
    ),
    "cup": (((42, 40), _CUP_DEG),),
    "alone": (((70, 75), {}),),
    "fingertip": (((4, 4, 58), {}),),
    "thumb-middle": (((), {"thumb_mcp.bend": 62}),),
    "thumb-tip": (((), {"thumb_ip.bend": 72}),),
}
"""Of fingers, knuckle, middle joint, fingertip, which else follows the middle joint; what goes along."""


@dataclass
class OwnPerson(Person):
    """Somebody of the project's own simulator, whose anatomy the estimator's prior is about."""

    realism: Realism

    def _meetings(self) -> list[Posture]:
        starts = np.repeat(rest_posture()[None], len(FINGERS), 0)
        met = contact_postures(hand_of(SUBJECT, self.hand, self.seed, self.realism), starts, self.realism)
        return [own_posture(own) for own in met]

    def _recorded(self, track: Array | None, seconds: float, turn: int) -> Performed:
        def change(motion: Motion) -> Motion:
            assert track is not None
            anatomy = hand_of(SUBJECT, self.hand, self.seed, self.realism)
            deg = track.reshape(len(track), len(JOINTS), 2)
            angles = np.concatenate([np.radians(deg), np.zeros((*deg.shape[:2], 1))], -1)
            return Motion(coupled_angles(angles, anatomy, self.realism), motion.wrist_mm, motion.forearm)

        own = (SUBJECT, self.hand, "rom", self.seed, self.realism, round(seconds * RATE_HZ))
        made = simulate(*own, trial=str(turn), change=None if track is None else change)
        halves = {name: np.array([one.parent_mm, one.child_mm]) for name, one in made.truth.joints.items()}
        return Performed(made.poses(), halves)


def own_posture(deg: Array) -> Posture:
    """Give a posture (J, 2) of the project's simulator by its angles' names."""
    names = [f"{joint}.{kind}" for joint in JOINTS for kind in ("bend", "sway")]
    return dict(zip(names, deg.ravel().tolist(), strict=True))


@dataclass
class OtherPerson(Person):
    """Somebody of the second drawing, which shares nothing with the estimator."""

    person: other_hands.Person

    def _meetings(self) -> list[Posture]:
        thumb = {"thumb_cmc.bend": 14, "thumb_cmc.sway": 30, "thumb_mcp.bend": 20, "thumb_ip.bend": 25}
        met = []
        for n, finger in enumerate(FINGERS):
            deg = {"mcp": 48 + 3 * n, "pip": 42 + 4 * n, "dip": 20}
            bent = {f"{finger}_{kind}.bend": own for kind, own in deg.items()}
            start = self.rest | thumb | bent | {"little_cmc.bend": 5 * n, "ring_cmc.bend": 2.5 * n}
            met.append(self.rest | touching(self.person, start, finger))
        return met

    def _recorded(self, track: Array | None, seconds: float, turn: int) -> Performed:
        tracks = {} if track is None else dict(zip(self.rest, track.T, strict=True))
        moved = self.person.joints if tracks else ()
        angles = {joint.name: np.column_stack([tracks[own] for own in joint.angles]) for joint in moved}
        made = other_hands.record(
            self.person,
            self.hand,
            OPPOSITION if tracks else "calibration",  # in the former the hand never lies on the table
            seed=1000 * self.seed + turn,
            duration_s=seconds,
            angles_deg=angles or None,
            place_mm=np.random.default_rng(self.seed).uniform([270, -90, -70], [380, 90, 70]),
        )
        return Performed(made.poses, true_halves(made))


def draw(drawing: str, seed: int, *, odd: bool = False) -> Person:
    """Draw somebody; odd : whose hand is unlike the prior: outside of every source, or a child's."""
    hand = ("right", "left")[seed % 2]
    if drawing == OWN:
        realism = Realism(anatomy=MIXED_TABLE) if odd else Realism()
        return OwnPerson(seed, hand, own_posture(rest_posture()), OWN_REACH, 0.7, realism)
    assert drawing == OTHER
    facing = FACINGS[seed % len(FACINGS)]
    person = other_hands.draw_person(seed, thumb_facing=facing, scale=0.72 if odd else None)
    names = [name for joint in person.joints for name in joint.angles]
    rest = {name: 4.0 if name.endswith(("mcp.bend", "pip.bend")) else 0.0 for name in names}
    return OtherPerson(seed, hand, rest, person.habits["reach"], person.habits["tip_share"], person)
