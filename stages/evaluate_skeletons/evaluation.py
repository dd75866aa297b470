"""All rows of a hand: every skeleton and every reference in every recording, and their joints' errors."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, nullcontext
from functools import cache

from shukotsu.anatomy.known_digits import known_digits
from shukotsu.schemas.catalogue import JOINT_ERRORS, SKELETON_SCORES
from shukotsu.schemas.config_files import REFERENCE
from shukotsu.schemas.parts import open_parts
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.poses import RecordingName
from shukotsu.schemas.study import Recording
from shukotsu.stages.evaluate_skeletons.scored_skeleton import Row, ScoredSkeleton, read_skeleton
from shukotsu.stages.evaluate_skeletons.scores import (
    EvaluatedRecording,
    distal_receiver_row,
    evaluated_recording,
    score_skeleton,
    true_skeleton_row,
)
from shukotsu.stages.evaluate_skeletons.truth import Truth, joint_errors, read_truth, truth_for


def evaluate_hand(plan: SubjectPlan, hand: str) -> tuple[list[Row], list[Row]]:
    """Return rows of skeleton_scores and of joint_errors of a hand, of each key the first.

    A model that never used a task is the same without it. Raises InputError for another's truth.
    """
    truths = _truths(plan, hand)
    with ExitStack() as stack:
        open_once = cache(lambda path, table: stack.enter_context(open_parts(path, table)))
        opened = lambda path, table: nullcontext(open_once(path, table))  # noqa: E731
        parts = [part for part in plan.parts() if part.hand == hand]
        if known_digits(plan.layouts[hand]):
            parts.append(plan.part(hand, REFERENCE))
        skeletons = [read_skeleton(opened, plan, part) for part in parts]
        scores = [
            row
            for recording in plan.evaluated(hand)
            for row in _score_rows(evaluated_recording(plan, recording, truths.get(recording)), skeletons)
        ]
    errors = []
    for skeleton in skeletons:
        truth = truth_for(skeleton.tasks, list(truths.values()))
        if truth is not None:
            keys = {"model": skeleton.reader.part.model, "calibrated_on": skeleton.calibrated_on}
            errors += [keys | row for row in joint_errors(skeleton.stated, truth, plan.layouts[hand])]
    return _first_of_each(scores, SKELETON_SCORES.key), _first_of_each(errors, JOINT_ERRORS.key)


def _first_of_each(rows: Sequence[Row], key: Sequence[str]) -> list[Row]:
    first: dict[tuple[object, ...], Row] = {}
    for row in rows:
        first.setdefault(tuple(row.get(name) for name in key), row)
    return list(first.values())


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
        if skeleton.reader.part.made_without in ("", recording.name.task):  # its tables are meant to hold it
            yield from score_skeleton(recording, skeleton)
    digits = recording.layout.digits.values()
    yield from (distal_receiver_row(recording, digit) for digit in digits)
    yield from (row for digit in digits if (row := true_skeleton_row(recording, digit)) is not None)
