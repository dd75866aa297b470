"""All rows of a hand: every skeleton and every reference in every recording, and their joints' errors."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import RecordingName
from shukotsu.schemas.study import Recording
from shukotsu.stages.evaluate_skeletons.references import distal_receiver_row, true_skeleton_row
from shukotsu.stages.evaluate_skeletons.scored_skeleton import (
    OpenTables,
    Row,
    ScoredSkeleton,
    read_prior,
    read_skeleton,
)
from shukotsu.stages.evaluate_skeletons.scores import EvaluatedRecording, evaluated_recording, score_skeleton
from shukotsu.stages.evaluate_skeletons.truth import Truth, read_truth
from shukotsu.stages.evaluate_skeletons.truth_errors import joint_errors, truth_for


def evaluate_hand(plan: SubjectPlan, hand: str) -> tuple[list[Row], list[Row]]:
    """Give the rows of skeleton_scores and of joint_errors of one hand.

    Raises TableError where a table is not what it should be, InputError where a truth is not.
    """
    truths = _truths(plan, hand)
    with OpenTables() as tables:
        skeletons = [read_skeleton(tables, plan, part) for part in plan.parts() if part.hand == hand]
        skeletons += filter(None, [read_prior(tables, plan, hand)])
        scores = [
            row
            for recording in plan.evaluated(hand)
            for row in _score_rows(evaluated_recording(plan, recording, truths.get(recording)), skeletons)
        ]
    errors = []
    for skeleton in skeletons:
        truth = truth_for(skeleton.tasks, list(truths.values()))
        if truth is not None:
            keys = {"model": skeleton.part.model, "calibrated_on": skeleton.calibrated_on}
            errors += [keys | row for row in joint_errors(skeleton.stated, truth, plan.layouts[hand])]
    return scores, errors


def _truths(plan: SubjectPlan, hand: str) -> dict[Recording, Truth]:
    """Truths of a hand's recordings that are there; one that is not costs its columns and no more."""
    truths = {}
    for recording in plan.recordings_of(hand, "calibration", "evaluation", "both"):
        folder = plan.truth(recording)
        if folder is not None and folder.is_dir():
            name = RecordingName(plan.subject, hand, recording.task, recording.trial, plan.session)
            truths[recording] = read_truth(folder, name)
        elif folder is not None:
            print(f"note: no truth: {folder}: no such folder", file=sys.stderr)
    return truths


def _score_rows(recording: EvaluatedRecording, skeletons: Sequence[ScoredSkeleton]) -> Iterator[Row]:
    """Rows of skeleton_scores of one recording: skeletons first, then references without a skeleton."""
    for skeleton in skeletons:
        if skeleton.evaluates(recording.name):
            yield from score_skeleton(recording, skeleton)
    digits = recording.layout.digits.values()
    yield from (distal_receiver_row(recording, digit) for digit in digits)
    yield from (row for digit in digits if (row := true_skeleton_row(recording, digit)) is not None)
