"""One person with receivers on, in front of the coach: what was asked, done and known at each moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.coached.people import FREE, RATE_HZ, REST, Person
from benchmarks.faultless_hands import exchanged
from shukotsu.coach.coach import ENOUGH, Coach
from shukotsu.coach.live_poses import Arrived
from shukotsu.coach.movements import MOVEMENTS
from shukotsu.coach.requests import MOVEMENT
from shukotsu.coach.setup import CoachSetup
from shukotsu.schemas.verdict import BELIEVE
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.posterior_summary import FittedJoint

CHUNK_FRAMES, TALKING = 60, 0.12
"""Frames that come at once; share of their range that hands move through while people talk."""

SWAPPED_S, HANDLED_S = 10.0, 3.0
"""Receivers that are swapped are so for so long; and putting them right takes so long."""

OTHER_MOVEMENT, HALF_RANGE, PAUSE, TALK = 0.1, 0.2, 0.15, 0.15
"""How often somebody does another movement than was asked, half of it, waits first, or talks first."""


@dataclass(frozen=True)
class Known:
    """An estimate, joint by joint: error of the worse half and stated sd (J,), mm, and what is believed."""

    time_s: float
    error_mm: Array
    sd_mm: Array
    believed: Array


@dataclass
class Session:
    """What came of a session. said : the coach's log and findings: when, what kind, of what."""

    known: list[Known] = field(default_factory=list)
    said: list[tuple[float, str, str]] = field(default_factory=list)

    def seconds_of(self, kind: str) -> list[float]:
        """When the coach said such a thing."""
        return [time_s for time_s, own, _ in self.said if own == kind]

    def at(self, time_s: float) -> Known | None:
        """Give the newest estimate at a time, of since the last new beginning and until it was enough."""
        began_s = max((own for own in self.seconds_of("put-right") if own <= time_s), default=0.0)
        end_s = min([time_s, *self.seconds_of(ENOUGH)])
        return next((own for own in reversed(self.known) if began_s <= own.time_s <= end_s), None)


def errors_mm(joints: Mapping[str, FittedJoint], truth: Mapping[str, Array]) -> Array:
    """Give the error (J,) of each joint's worse half."""
    halves = [(np.array([own.parent_mm, own.child_mm]), truth[name]) for name, own in joints.items()]
    return np.array([np.linalg.norm(found - true, axis=1).max() for found, true in halves])


@dataclass
class Room:
    """A person, the coach, and what passed between them. swapped : receivers that stand for each other."""

    person: Person
    setup: CoachSetup
    rng: np.random.Generator
    swapped: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        self.coach, self.session = Coach(self.setup), Session()
        self._frames = 0
        self._parts: list[tuple[int, Mapping[str, Array]]] = []

    def spend(self, seconds: float) -> Session:
        """Let the person do what the coach asks, clumsily, until it is enough."""
        self._do(REST, 0.5)
        while self._frames < seconds * RATE_HZ and not self._has_enough():
            if self.swapped and self._frames >= SWAPPED_S * RATE_HZ:
                self.swapped = None
                self._do(REST, HANDLED_S)
            elif self.coach.request is None or self.coach.request.option.kind != MOVEMENT:
                self._do(FREE, self.rng.uniform(0.8, 1.5), TALKING)
            else:
                self._obey(self.coach.request.option.name)
        log = [(at_s, str(what["kind"]), str(what.get("name", ""))) for at_s, what in self.coach.log]
        self.session.said = sorted([*self.session.said, *log])
        return self.session

    def _obey(self, name: str) -> None:
        """Read the request, do it or something like it, and wait whether that was seen."""
        rng, asked = self.rng, self._asked()
        if rng.random() < PAUSE:
            self._do(REST, rng.uniform(0.5, 2.0))
        if rng.random() < TALK:
            self._do(FREE, rng.uniform(0.8, 1.5), TALKING)
        self._do(REST, rng.uniform(0.7, 1.3))
        name = str(rng.choice(list(MOVEMENTS))) if rng.random() < OTHER_MOVEMENT else name
        self._do(name, MOVEMENTS[name].seconds, 0.5 if rng.random() < HALF_RANGE else 1.0)
        for _ in range(4):
            if self._asked() == asked:
                self._do(REST, 0.5)

    def _has_enough(self) -> bool:
        return any(what["kind"] == ENOUGH for _, what in self.coach.log)

    def _asked(self) -> tuple[int, int] | None:
        request = self.coach.request
        return None if request is None else (request.number, request.times)

    def _do(self, movement: str, seconds: float, reach: float = 1.0) -> None:
        """Record a movement, and let the coach see it piece by piece."""
        performed = self.person.perform(movement, seconds, reach, turn=len(self._parts) + 1)
        poses = performed.poses if self.swapped is None else exchanged(performed.poses, self.swapped)
        frame = self._frames + np.arange(len(poses.frame))
        poses = replace(poses, frame=frame, time_s=frame / RATE_HZ)
        self._parts.append((self._frames, performed.halves))
        for start in range(0, len(frame), CHUNK_FRAMES):
            rows = slice(start, start + CHUNK_FRAMES)
            self._frames += len(frame[rows])
            self._see(Arrived(poses.take(rows), (frame[rows] * 1e9 / RATE_HZ).astype(np.int64)))

    def _see(self, arrived: Arrived) -> None:
        coach, before, findings = self.coach, self.coach.known, self.coach.findings
        coach.take(arrived)
        if coach.findings is not findings:
            found = [one["finding"] for one in coach.findings if "finding" in one]
            self.session.said += [(coach.time_s, "finding", f"{one.kind} {one.values}") for one in found]
        if coach.known is not None and coach.known is not before:
            errors = errors_mm(coach.known.fit.joints, self._truth())
            believed = [row["verdict"] == BELIEVE for row in coach.known.rows.values()]
            self.session.known.append(Known(coach.time_s, errors, coach.known.sd_mm, np.array(believed)))

    def _truth(self) -> Mapping[str, Array]:
        """Centres as they rode, on average over the frames since the coach began (anew)."""
        starts = np.array([start for start, _ in self._parts] + [self._frames])
        counts = np.diff(np.maximum(starts, round(self.coach.began_s * RATE_HZ)))
        parts = [halves for _, halves in self._parts]
        return {n: np.average([own[n] for own in parts], axis=0, weights=counts) for n in parts[0]}
