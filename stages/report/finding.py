"""What a study found, in sentences: how much of it there is, how well it closes, what is doubtful."""

from __future__ import annotations

from collections import Counter

from stages.report.data_table import counted, listed, number
from stages.report.study_results import LEAST_SQUARES, StudyResults


def used_in_words(results: StudyResults) -> str:
    """How many of the recordings were used, in a sentence."""
    statuses = Counter(results.status_of(recording)[0] for recording in results.study.recordings)
    total = len(results.study.recordings)
    others = [f"{count} {status}" for status, count in sorted(statuses.items()) if status != "used"]
    rest = f" ({listed(others)})" if others else ""
    verb = "was" if statuses["used"] == 1 else "were"
    return f"{statuses['used']} of {counted(total, 'recording')} {verb} used{rest}."


def finding(results: StudyResults) -> str:
    """The finding in one paragraph of plain sentences; errors in mm, least-squares binding."""
    sentences = [used_in_words(results)]
    if results.study.simulation is not None:
        sentences.append("The recordings are simulated; no person's hand is behind these numbers.")
    return " ".join([*sentences, _errors(results), _doubts(results)])


def mean_tip_errors(results: StudyResults, *, held_out: bool) -> dict[str, float]:
    """Mean of the digits' mean tip errors, mm, by model; models without any are left out."""
    means: dict[str, float] = {}
    for model in results.models:
        values = [
            row["mean_mm"]
            for row in results.tip_errors
            if row["model"] == model
            and row["binding"] == LEAST_SQUARES
            and row["held_out"] == held_out
            and row["mean_mm"] is not None
        ]
        if values:
            means[model] = sum(values) / len(values)
    return means


def _errors(results: StudyResults) -> str:
    """The models' mean tip errors; held-out ones first, those on the joints' own recordings in brackets."""
    held_out, seen = mean_tip_errors(results, held_out=True), mean_tip_errors(results, held_out=False)
    if not held_out and not seen:
        return "No tip error could be computed with any model."
    what = (
        "the replayed fingertip misses the fingertip receiver, on average over digits and hands with the "
        "least-squares binding, by"
    )
    if not held_out:
        means = listed(f"{number(mean)} mm ({model})" for model, mean in seen.items())
        return f"On the recordings that the joints were solved from (nothing is held out) {what} {means}."
    if not seen:
        means = listed(f"{number(mean)} mm ({model})" for model, mean in held_out.items())
        return f"On held-out recordings (the joints were solved from others) {what} {means}."
    means = listed(
        f"{number(held_out.get(model))} ({number(seen.get(model))}) mm with {model}"
        for model in results.models
        if model in held_out or model in seen
    )
    return f"On held-out recordings (in brackets: on those that the joints were solved from) {what} {means}."


def _doubts(results: StudyResults) -> str:
    """Weak and failed joints by model, models with the same count together."""
    groups: dict[str, list[str]] = {}
    for model in results.models:
        statuses = Counter(row["status"] for row in results.joints if row["model"] == model)
        total = sum(statuses.values())
        if not total:
            text = "no joint was solved"
        elif statuses["weak"] or statuses["failed"]:
            doubts = [f"{statuses[word]} {word}" for word in ("weak", "failed") if statuses[word]]
            text = f"{listed(doubts)} of {counted(total, 'joint')}"
        else:
            continue
        groups.setdefault(text, []).append(model)
    if not groups:
        return "No joint is marked doubtful."
    parts = "; ".join(f"{text} ({listed(models)})" for text, models in groups.items())
    return f"Doubtful: {parts}; see “Joints” for the reasons."
