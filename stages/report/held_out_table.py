"""Which skeletons were scored on recordings that they were made from, and which were not."""

from __future__ import annotations

from stages.report.score_tables import tasks_text
from stages.report.study_results import StudyResults
from stages.report.table_cells import Block, DataTable, counted

HELD_OUT, IN_SAMPLE = "held out", "○ in-sample"


def held_out_table(results: StudyResults) -> DataTable | None:
    """A row for every model, what it was made from and what it was scored on; None where nothing was."""
    hands: dict[tuple[str, str, str, bool], set[tuple[str, str]]] = {}
    for row in results.scores:
        if not row["reference"]:
            key = (row["model"], row["calibrated_on"], row["task"], row["held_out"])
            hands.setdefault(key, set()).add((row["subject"], row["hand"]))
    if not hands:
        return None
    order = list(results.models)
    keys = sorted(hands, key=lambda key: (order.index(key[0]), not key[3], key[1:3]))
    rows = tuple(
        (model, tasks_text(made_from), task, HELD_OUT if fresh else IN_SAMPLE, _hands(hands[key]))
        for key in keys
        for model, made_from, task, fresh in [key]
    )
    return DataTable(
        "What skeletons were made from, and what they were scored on.",
        (Block(("Model", "Made from", "Scored on", "The score is", "Hands"), rows),),
        (
            "A held-out score judges a skeleton by recordings that it has not seen. An in-sample one tells "
            "how well it describes what it was made from.",
        ),
        frozenset(range(5)),
    )


def _hands(found: set[tuple[str, str]]) -> str:
    return f"{counted(len(found), 'hand')} of {counted(len({subject for subject, _ in found}), 'subject')}"
