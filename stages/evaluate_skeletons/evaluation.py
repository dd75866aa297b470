"""All rows of a hand: every skeleton and every reference in every recording, and their joints' errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from schemas.errors import InputError
from schemas.layout import Layout
from schemas.poses import RecordingName
from stages.evaluate_skeletons.references import (
    DISTAL_RECEIVER,
    PRIOR_ONLY,
    Prior,
    distal_receiver_row,
    prior_rows,
    true_skeleton_row,
)
from stages.evaluate_skeletons.scores import Recording, score_folder, wrist_mcp_sd
from stages.evaluate_skeletons.skeleton_folder import SkeletonFolder
from stages.evaluate_skeletons.truth_errors import joint_errors, truth_for
from stages.evaluate_skeletons.truth_folder import TruthFolder

Row = dict[str, Any]


def score_rows(recording: Recording, folders: Sequence[SkeletonFolder], prior: Prior | None) -> list[Row]:
    """Give the rows of skeleton_scores of one recording: skeletons first, then references.

    prior : None where the layout's digits have no known anatomy.
    """
    try:
        return list(_score_rows(recording, folders, prior))
    except InputError as error:  # some receivers' poses cannot be read
        return list(_score_rows(replace(recording, message=str(error)), folders, prior))


def _score_rows(
    recording: Recording, folders: Sequence[SkeletonFolder], prior: Prior | None
) -> Iterator[Row]:
    layout = recording.layout
    scored = [folder for folder in folders if folder.evaluates(recording.name)]
    wrist_mcp: list[dict[str, float | None]] = [{} for _ in scored]
    distal_receiver, true_skeleton = [], []
    for digit in layout.digits.values():
        if recording.message:
            distal_receiver.append(recording.row(digit.name, DISTAL_RECEIVER))
            continue
        ends = recording.blocks(digit.base, *digit.segments[1:2])
        found = wrist_mcp_sd(ends, digit, layout, [folder.stated.joints for folder in scored])
        for sd_mm, value in zip(wrist_mcp, found, strict=True):
            sd_mm[digit.name] = value
        distal_receiver.append(distal_receiver_row(recording, digit))
        if digit.name in recording.truth:
            true_skeleton.append(true_skeleton_row(recording, digit, recording.poses(digit)))
    for sd_mm, folder in zip(wrist_mcp, scored, strict=True):
        yield from score_folder(recording, folder, sd_mm)
    yield from [] if prior is None else prior_rows(prior, recording)
    yield from distal_receiver
    yield from (row for row in true_skeleton if row is not None)


def joint_rows(
    calibration: Sequence[RecordingName],
    layout: Layout,
    folders: Sequence[SkeletonFolder],
    truths: Sequence[TruthFolder],
    prior: Prior | None,
) -> Iterator[Row]:
    """Give the rows of joint_errors (subject and hand left out); none without a truth."""
    tasks = [name.task for name in calibration]
    for folder in folders:
        truth = truth_for(tasks if folder.calibrated_on is None else folder.tasks, truths)
        if truth is not None:
            words = {"model": folder.model, "calibrated_on": folder.calibrated_text}
            yield from (words | row for row in joint_errors(folder.stated, truth, layout))
    truth = truth_for(tasks, truths)
    if prior is not None and truth is not None:
        words = {"model": PRIOR_ONLY, "calibrated_on": ""}
        yield from (words | row for row in joint_errors(prior.stated, truth, layout))
