"""Choose what to ask for next: the movement, touch or length that would gain most for the seconds that it
takes.

What is weighed is the joints' stated error as a study states it; an error below what the study asks counts as
that, so that only joints that are not good enough yet have a say.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from shukotsu.coach.estimate import Estimate
from shukotsu.coach.expected_gains import SAMPLES_PER_S, imagined_states, information
from shukotsu.coach.movements import MOVEMENTS
from shukotsu.coach.setup import CoachSetup
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.gains import TOUCH, CentreRows, expected_sd_mm

MOVEMENT, TOUCHING, MEASURE = "movement", "touch", "measure"
LISTEN_S = 1.0
"""To read or hear a request, and to begin."""

TOUCH_S, MEASURE_S = 5.0, 20.0
"""A fingertip on a point that is known; a length by calliper, read and typed (our estimates)."""

WORTH = 0.1
"""A request must lower the error of a joint that is not good enough by more than this share of it, or make it
good enough."""


@dataclass(frozen=True)
class Option:
    """Something that can be asked for. name : of the movement, the digit or the quantity; sd_mm : (J,) that
    it would leave.
    """

    kind: str
    name: str
    seconds: float
    sd_mm: Array


def excess_mm(sd_mm: Array, wanted_mm: float) -> float:
    """Root mean square of stated errors (J,), those that are good enough counting as what is wanted."""
    return float(np.sqrt(np.mean(np.maximum(sd_mm, wanted_mm) ** 2)))


def choose(
    setup: CoachSetup,
    known: Estimate,
    refused: Collection[str],
    since: Mapping[str, float],
    gains: dict[str, Array],
) -> Option | None:
    """Choose among movements, touches and lengths; None where none is worth it. refused : names that are not
    to be asked for again. since : seconds of each movement that was done since the estimate. gains :
    information of a second of each movement, kept for this estimate from one choice to the next.
    """
    fit = known.fit
    rows, precision = (
        CentreRows.of(fit, list(known.rows)),
        np.asarray(np.linalg.inv(fit.evidence.posterior.covariance), float),
    )
    for name, movement in MOVEMENTS.items():
        if name not in gains and (name in since or name not in refused):
            gains[name] = information(fit, imagined_states(fit, movement), SAMPLES_PER_S)
    for name, seconds in since.items():
        precision = precision + seconds * gains[name]
    now_mm = rows.sd_mm(precision)
    moves = [
        Option(MOVEMENT, name, own.seconds, rows.sd_mm(precision + own.seconds * gains[name]))
        for name, own in MOVEMENTS.items()
        if name not in refused
    ]
    options = [*moves, *_measuring(setup, known, refused)]
    still_open = np.array([name in known.open_joints for name in known.rows])
    worth = [
        own
        for own in options
        if (own.sd_mm <= np.maximum((1 - WORTH) * now_mm, setup.wanted_mm))[still_open].any()
    ]
    return max(worth, key=lambda option: _rate(option, now_mm, setup.wanted_mm), default=None)


def _rate(option: Option, now_mm: Array, wanted_mm: float) -> float:
    gain = excess_mm(now_mm, wanted_mm) - excess_mm(option.sd_mm, wanted_mm)
    return gain / (option.seconds + LISTEN_S)


def _measuring(setup: CoachSetup, known: Estimate, refused: Collection[str]) -> Iterator[Option]:
    if not (setup.calliper or setup.points):
        return
    quantities, after = expected_sd_mm(known.tips)
    measured = {row["quantity"] for row in setup.measurements}
    shown = [list(known.fit.joints).index(name) for name in known.rows]
    for quantity, sd_mm in zip(quantities, after.T[:, shown], strict=True):
        digit, _, part = quantity.rpartition(".")
        kind, name, seconds = (TOUCHING, digit, TOUCH_S) if part == TOUCH else (MEASURE, quantity, MEASURE_S)
        if name not in {*refused, *measured} and (setup.points if kind == TOUCHING else setup.calliper):
            yield Option(kind, name, seconds, sd_mm)
