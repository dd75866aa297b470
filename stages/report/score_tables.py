"""The skeletons' scores in one evaluated task: every model and every reference, a row each.

A skeleton is a model made from certain tasks: a model has a row for each set of tasks that it was made from.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from functools import partial
from typing import NamedTuple

from shukotsu.sentences.translation import N_, ngettext, tr, translated
from shukotsu.stages.report.study_results import Row, StudyResults, Trial
from shukotsu.stages.report.table_cells import DASH, Column, DataTable, heading, shown, table_of_blocks

IN_SAMPLE = N_("○ no")
MEANS = (
    "replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm", "metacarpal_deg",
    "true_tip_mean_mm",
)  # fmt: skip
LEFT_OUT = "left_out_mean_mm"
"""A replay never uses the distal receivers' positions: without a posed hand this is the replay's, and stands
in its column alone.
"""


class Skeleton(NamedTuple):
    """A model with the tasks that it was made from, or a reference."""

    model: str
    calibrated_on: str
    held_out: bool
    reference: bool

    @property
    def made_from(self) -> str:
        """The tasks that it was made from; a dash for a reference, which was made from none."""
        return DASH if self.reference else tasks_text(self.calibrated_on)

    @property
    def unseen(self) -> str:
        """Whether it was made without the task that it is scored on, in words."""
        return DASH if self.reference else tr("yes") if self.held_out else tr(IN_SAMPLE)


_SKELETON = (
    Column(N_("Skeleton"), lambda scored: scored[0].model, is_text=True),
    Column(N_("Made from"), lambda scored: scored[0].made_from, is_text=True),
    Column(N_("Held out"), lambda scored: scored[0].unseen, is_text=True),
)


def tasks_text(calibrated_on: str) -> str:
    """The tasks of a column calibrated_on."""
    return ", ".join(calibrated_on.split(";")) or tr("unknown")


def score_table(results: StudyResults, trial: Trial) -> DataTable | None:
    """The scores of one subject's task, means over digits and hands; None where it has none.

    Columns without a number are left out: those of a truth that the study does not have, for instance.
    """
    rows = results.scores_in(trial)
    found = _in_order(results, rows)
    if not found:
        return None
    names = [name for name in MEANS if any(_is_known(name, row) for row in rows)]
    columns = (*_SKELETON, *(Column(heading(name), partial(_mean_text, name)) for name in names))
    blocks = {
        kind: [(own, of) for own, of in found.items() if own.reference == is_reference]
        for kind, is_reference in ((tr("Skeleton"), False), (tr("Reference"), True))
    }
    caption = tr("Mean over digits and hands: {who}, {title}.", who=trial.who, title=trial.title)
    return table_of_blocks(caption, columns, blocks, _shortfalls(results, trial, found, names))


def _in_order(results: StudyResults, rows: Iterable[Row]) -> dict[Skeleton, list[Row]]:
    """Rows by skeleton: held-out ones, in-sample ones, references; within each as the study names them."""
    groups: dict[Skeleton, list[Row]] = defaultdict(list)
    for row in rows:
        groups[Skeleton(row["model"], row["calibrated_on"], row["held_out"], row["reference"])].append(row)
    names = list(results.models)
    ordered = sorted(
        groups,
        key=lambda s: (s.reference, not s.held_out, names.index(s.model) if s.model in names else len(names)),
    )
    return {skeleton: groups[skeleton] for skeleton in ordered}


def _mean_text(name: str, scored: tuple[Skeleton, list[Row]]) -> str:
    return shown(name, mean(row[name] for row in scored[1] if _is_known(name, row)))


def _is_known(name: str, row: Row) -> bool:
    return row[name] is not None and (name != LEFT_OUT or row["posed_mean_mm"] is not None)


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of what is there; None where nothing is."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _shortfalls(
    results: StudyResults, trial: Trial, found: dict[Skeleton, list[Row]], names: list[str]
) -> tuple[str, ...]:
    """Which skeletons' means are over fewer digits than the task has, and why; the same reason once."""
    total = sum(len(results.layouts[r.hand].digits) for r in trial.recordings.values())
    models_of: dict[str, dict[str, None]] = defaultdict(dict)
    for skeleton, rows in found.items():
        counts = [sum(row[name] is not None for row in rows) for name in names]
        fewest = min((count for count in counts if count), default=0)
        parts = dict.fromkeys(translated(row["message"]).rstrip(".。") for row in rows if row["message"])
        digits = ngettext("{n} digit", "{n} digits", total)
        short = [tr("{fewest} of {digits}", fewest=fewest, digits=digits)] if fewest < total else []
        if short or parts:
            models_of["; ".join([*short, *parts])][skeleton.model] = None
    return tuple(f"{', '.join(models)}: {text}." for text, models in models_of.items())
