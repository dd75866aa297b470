"""What the skeletons are worth: every model and every reference in one evaluated task.

A skeleton is a model made from certain tasks: a model has a row for each set of tasks that it was made from.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from stages.report.study_results import HANDS, Row, StudyResults, Trial
from stages.report.table_cells import DASH, Block, DataTable, Folded, counted, number

IN_SAMPLE = "○ no"


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
    def seen(self) -> str:
        """Whether it was made without the task that it is scored on."""
        return DASH if self.reference else "yes" if self.held_out else IN_SAMPLE

    @property
    def title(self) -> str:
        """The model and what it was made from."""
        return self.model if self.reference else f"{self.model} (from {self.made_from})"


class Score(NamedTuple):
    """A column of the scores: its name in the table, its heading on the page and in the terminal."""

    name: str
    heading: str
    short: str = ""


MEANS = (
    Score("replay_mean_mm", "Tip error of the replay [mm]", "replay"),
    Score("posed_mean_mm", "Posed with all receivers [mm]", "posed"),
    Score("left_out_mean_mm", "Distal positions left out [mm]", "left out"),
    Score("wrist_mcp_sd_mm", "SD of wrist to MCP [mm]", "wr-MCP"),
    Score("metacarpal_deg", "Metacarpal direction [deg]", "metac."),
    Score("true_tip_mean_mm", "True fingertip [mm]", "true tip"),
)
OF_A_DIGIT = (
    *MEANS[:1],
    Score("replay_p95_mm", "p95 [mm]"),
    *MEANS[1:3],
    Score("left_out_p95_mm", "p95 [mm]"),
    *MEANS[3:],
    Score("true_tip_p95_mm", "p95 [mm]"),
)
LEFT_OUT = ("left_out_mean_mm", "left_out_p95_mm")
"""A replay never uses the distal receivers' positions: without a posed hand these are the replay's."""


def tasks_text(calibrated_on: str) -> str:
    """The tasks of a column calibrated_on."""
    return ", ".join(calibrated_on.split(";")) or "unknown"


def score_table(results: StudyResults, trial: Trial) -> DataTable | None:
    """The scores of one subject's task, means over digits and hands; None where it has none.

    Held-out skeletons stand first, in-sample ones next, references apart. Columns without a number are left
    out: those of a truth that the study does not have, for instance.
    """
    found = _skeletons(results, trial)
    if not found:
        return None
    scores = _with_numbers(MEANS, results.scores_in(trial))
    headings = tuple(score.heading for score in scores)
    blocks = (
        Block(
            (kind, "Made from", "Held out", *headings),
            tuple((s.model, s.made_from, s.seen, *_means(found[s], scores)) for s in found if wanted(s)),
        )
        for kind, wanted in _kinds()
    )
    return DataTable(
        f"Mean over digits and hands: subject {trial.subject}, {trial.title}.",
        tuple(block for block in blocks if block.rows),
        _shortfalls(results, trial, found, scores),
        frozenset({0, 1, 2}),
    )


def digit_tables(results: StudyResults, trial: Trial) -> list[Folded]:
    """The same digit by digit, with 95th percentiles: a folded table a hand, a block a digit."""
    folded = []
    for hand in HANDS:
        rows = [row for row in results.scores_in(trial) if row["hand"] == hand]
        if not rows:
            continue
        scores = _with_numbers(OF_A_DIGIT, rows)
        headings = ("Made from", "Held out", *(score.heading for score in scores), "Frames")
        headings += ("Message",) if any(row["message"] for row in rows) else ()
        found = _in_order(results, rows)
        blocks = tuple(
            Block((_capital(digit), *headings), tuple(_digit_cells(found, digit, scores, len(headings) + 1)))
            for digit in dict.fromkeys(row["digit"] for row in rows)
        )
        caption = (
            f"Digit by digit: subject {trial.subject}, {hand} hand, {trial.title}; p95: 95th percentile."
        )
        text = {0, 1, 2} | ({len(headings)} if headings[-1] == "Message" else set())
        table = DataTable(caption, blocks, (), frozenset(text))
        folded.append(Folded(f"{hand.capitalize()} hand, digit by digit", table))
    return folded


def compact_score_table(results: StudyResults, trial: Trial) -> DataTable | None:
    """The scores for the terminal, what skeletons were made from in notes; None where there are none."""
    found = _skeletons(results, trial)
    if not found:
        return None
    scores = _with_numbers(MEANS, results.scores_in(trial))
    kinds: tuple[tuple[str, Callable[[Skeleton], bool]], ...] = (
        ("Held out", lambda s: s.held_out and not s.reference),
        ("In-sample", lambda s: not s.held_out and not s.reference),
        ("Reference", lambda s: s.reference),
    )
    blocks = (
        Block(
            (kind, *(score.short for score in scores)),
            tuple((s.model, *_means(found[s], scores)) for s in found if wanted(s)),
        )
        for kind, wanted in kinds
    )
    legend = "; ".join(f"{score.short}: {score.heading}" for score in scores)
    return DataTable(
        f"Skeletons, mean over digits and hands: subject {trial.subject}, {trial.title}.",
        tuple(block for block in blocks if block.rows),
        (
            f"{legend}. The replay, and what is in brackets, does not judge a skeleton (docs/evaluation.md).",
            *_made_from(found),
            *_shortfalls(results, trial, found, scores),
        ),
    )


def _kinds() -> tuple[tuple[str, Callable[[Skeleton], bool]], ...]:
    return ("Skeleton", lambda s: not s.reference), ("Reference", lambda s: s.reference)


def _skeletons(results: StudyResults, trial: Trial) -> dict[Skeleton, list[Row]]:
    return _in_order(results, results.scores_in(trial))


def _in_order(results: StudyResults, rows: Iterable[Row]) -> dict[Skeleton, list[Row]]:
    """Rows by skeleton: held-out ones, in-sample ones, references; within each as the study names them."""
    groups: dict[Skeleton, list[Row]] = defaultdict(list)
    for row in rows:
        key = Skeleton(row["model"], row["calibrated_on"], row["held_out"], row["reference"])
        groups[key].append(row)
    names = list(results.models)
    ordered = sorted(
        groups,
        key=lambda s: (s.reference, not s.held_out, names.index(s.model) if s.model in names else len(names)),
    )
    return {skeleton: groups[skeleton] for skeleton in ordered}


def _with_numbers(scores: Sequence[Score], rows: Iterable[Row]) -> list[Score]:
    rows = list(rows)
    return [score for score in scores if any(row[score.name] is not None for row in rows)]


def _means(rows: list[Row], scores: Iterable[Score]) -> tuple[str, ...]:
    return tuple(_cell(rows, score) for score in scores)


def _cell(rows: list[Row], score: Score) -> str:
    """The mean over rows of one skeleton; in brackets where what is left out was never used, see LEFT_OUT."""
    value = number(mean(row[score.name] for row in rows))
    replayed = all(row["posed_mean_mm"] is None for row in rows)
    return f"({value})" if score.name in LEFT_OUT and replayed and value != DASH else value


def mean(values: Iterable[float | None]) -> float | None:
    """The mean of what is there; None where nothing is."""
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _digit_cells(
    found: dict[Skeleton, list[Row]], digit: str, scores: list[Score], n_columns: int
) -> Iterable[tuple[str, ...]]:
    """The digit's rows, a skeleton a row, cut to so many columns: the message comes last."""
    for skeleton, rows in found.items():
        for row in (row for row in rows if row["digit"] == digit):
            numbers = (*_means([row], scores), number(row["n_frames"], 0))
            cells = (skeleton.model, skeleton.made_from, skeleton.seen, *numbers, row["message"])
            yield cells[:n_columns]


def _shortfalls(
    results: StudyResults, trial: Trial, found: dict[Skeleton, list[Row]], scores: list[Score]
) -> tuple[str, ...]:
    """Which skeletons' means are over fewer digits than the task has, and why; the same reason once."""
    total = sum(len(results.layouts[r.hand].digits) for r in trial.recordings.values())
    titles_of: dict[str, list[str]] = defaultdict(list)
    for skeleton, rows in found.items():
        counts = [sum(row[score.name] is not None for row in rows) for score in scores]
        fewest = min((count for count in counts if count), default=0)
        reasons = dict.fromkeys(row["message"].rstrip(".") for row in rows if row["message"])
        words = [f"{fewest} of {counted(total, 'digit')}"] if fewest < total else []
        if words or reasons:
            titles_of["; ".join([*words, *reasons])].append(skeleton.title)
    models = [skeleton.title for skeleton in found if not skeleton.reference]
    groups = {tuple(skeleton.title for skeleton in found): "All rows", tuple(models): "All models"}
    return tuple(
        f"{groups.get(tuple(names), '; '.join(names))}: {text}." for text, names in titles_of.items()
    )


def _made_from(found: dict[Skeleton, list[Row]]) -> list[str]:
    groups: dict[tuple[bool, str], list[str]] = defaultdict(list)
    for skeleton in found:
        if not skeleton.reference:
            groups[skeleton.held_out, skeleton.made_from].append(skeleton.model)
    return [
        f"{'Held out' if held_out else 'In-sample'}, made from {tasks}: {', '.join(models)}."
        for (held_out, tasks), models in groups.items()
    ]


def _capital(name: str) -> str:
    return name.replace("_", " ").capitalize()
