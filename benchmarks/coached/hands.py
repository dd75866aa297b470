"""One simulated person calibrated by the routine, and by the coach: until it is enough, and for as long."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np

from benchmarks.coached.people import ROUTINE, draw
from benchmarks.coached.session import Room, Session, errors_mm
from shukotsu.coach import requests
from shukotsu.coach.movements import FINGERS
from shukotsu.coach.setup import CoachSetup
from shukotsu.schemas.config_files import config_path, read_config
from shukotsu.schemas.layout import read_layout
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.fit import fit_hand
from shukotsu.stages.simulate.simulation import LAYOUT

ROUTINE_S, LONGEST_S, WANTED_MM, STRICT_MM = 25.0, 60.0, 2.0, 1.0
"""A study asks 2 mm by default; 1 mm hardly any joint has, so that the coach goes on."""

ODD_EVERY, SWAPPED_EVERY = 4, 5


@dataclass(frozen=True)
class Hand:
    """What came of a person. routine_mm : errors (J,) of the routine. usual, strict : coached sessions."""

    drawing: str
    swapped: tuple[str, str] | None
    routine_mm: Array
    usual: Session
    strict: Session


def one_hand(drawing: str, seed: int) -> Hand:
    """Calibrate one person in three ways. The strict coach asks also where little is to be gained."""
    person = draw(drawing, seed, odd=seed % ODD_EVERY == 0)
    swapped = neighbours(np.random.default_rng(seed)) if seed % SWAPPED_EVERY == 0 else None
    routine = person.perform(ROUTINE, ROUTINE_S)
    fit = fit_hand([routine.poses], read_layout(LAYOUT), person.hand)

    def coached(wanted_mm: float, seconds: float) -> Session:
        own = setup(person.hand, wanted_mm)
        return Room(person, own, np.random.default_rng([seed, 99]), swapped).spend(seconds)

    usual = coached(WANTED_MM, LONGEST_S)
    with mock.patch.object(requests, "WORTH", 0.0):
        strict = coached(STRICT_MM, ROUTINE_S)
    return Hand(drawing, swapped, errors_mm(fit.joints, routine.halves), usual, strict)


def setup(hand: str, wanted_mm: float) -> CoachSetup:
    """Give what the coach knows: a hand, the layout, and what is asked."""
    layout = read_config(config_path(LAYOUT, "layout", Path()), "layout") | {"wanted_mm": wanted_mm}
    model = read_config(config_path("whole-hand", "model", Path()), "model")
    return CoachSetup("benchmark", "01", hand, "", "rom", layout, wanted_mm, model)


def neighbours(rng: np.random.Generator) -> tuple[str, str]:
    """Choose two receivers that sit one behind the other on a digit."""
    digit, first = str(rng.choice(["thumb", *FINGERS])), int(rng.integers(2))
    bones = ("metacarpal", "proximal", "distal") if digit == "thumb" else ("proximal", "middle", "distal")
    return f"{digit}_{bones[first]}", f"{digit}_{bones[first + 1]}"
