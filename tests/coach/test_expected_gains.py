"""What a movement would gain, against what frames that were measured say."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from coached_hands import one_after_another, setup

from shukotsu.coach.estimate import Estimate, estimate
from shukotsu.coach.expected_gains import imagined_states, information
from shukotsu.coach.movements import MOVEMENTS
from shukotsu.coach.requests import excess_mm
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.gains import CentreRows


@cache
def known() -> Estimate:
    return estimate(setup(), setup().layout_of_hand(), one_after_another((("free", 3.0),)))


def centre_rows() -> tuple[CentreRows, Array]:
    """How centres hang on the unknowns, and how precisely these are known."""
    fit = known().fit
    return CentreRows.of(fit, list(known().rows)), np.linalg.inv(fit.evidence.posterior.covariance)


def test_imagined_frames_say_what_measured_ones_of_the_same_postures_said() -> None:
    """The fit's own frames, imagined: with what was known before them they give the fit's stated errors."""
    evidence = known().fit.evidence
    problem, n_frames = evidence.problem, len(evidence.states)
    before = np.diag(problem.precision) + problem.observations.rows.T @ problem.observations.rows
    said = information(known().fit, evidence.states, problem.temper * n_frames)
    again_mm = centre_rows()[0].sd_mm(before + said)
    np.testing.assert_allclose(again_mm, known().sd_mm, rtol=0.15)


def test_the_stated_errors_are_those_of_the_posterior() -> None:
    rows, precision = centre_rows()
    np.testing.assert_allclose(rows.sd_mm(precision), known().sd_mm, rtol=1e-6)


@pytest.mark.parametrize(
    ("movement", "joints"),
    [
        ("thumb-circle", {"thumb_cmc"}),
        ("thumb-tip", {"thumb_ip", "thumb_mcp", "thumb_cmc"}),
        ("fingertip-ring", {"ring_dip", "ring_pip"}),
    ],
)
def test_a_movement_gains_most_for_its_own_joints(movement: str, joints: set[str]) -> None:
    fit, (rows, precision) = known().fit, centre_rows()
    now = rows.sd_mm(precision)
    rest = rows.sd_mm(precision + information(fit, imagined_states(fit, MOVEMENTS["knuckles"]), 5.0))
    after = rows.sd_mm(precision + information(fit, imagined_states(fit, MOVEMENTS[movement]), 5.0))
    assert (after <= now + 1e-9).all()
    assert list(known().rows)[int(np.argmax(rest - after))] in joints


def test_more_of_a_movement_gains_more_and_less_each_time() -> None:
    fit, (rows, precision) = known().fit, centre_rows()
    once = information(fit, imagined_states(fit, MOVEMENTS["spread"]), 5.0)
    sd_mm = [excess_mm(rows.sd_mm(precision + times * once), 0.0) for times in range(4)]
    steps = -np.diff(sd_mm)
    assert (steps > 0).all()
    assert (np.diff(steps) < 0).all()
