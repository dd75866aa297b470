"""Choose the next step, in a sentence: settle what was found, else the one thing that would gain most.

Everything that could be done is weighed by the same number, the mean 1-sigma error of a hand's joint centres
before and after it, as the tables calibration_advice and gains have it, and the mean of that over the hands.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from statistics import mean

from shukotsu.schemas.advice import MOVE
from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.belief import joints_text
from shukotsu.stages.report.next_recording import doing_text
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import number

WORTH = 0.03
"""By this share of what the study asks of a centre a thing must lower the mean error to be worth doing."""

FEW_HANDS = 3
"""So many hands are named, of more the rest is counted."""


@dataclass(frozen=True)
class Step:
    """One thing to do, in words, and the mean error of the joints, mm, before and after it."""

    doing: str
    before_mm: float
    after_mm: float

    @property
    def gain_mm(self) -> float:
        """By how much it lowers the error."""
        return self.before_mm - self.after_mm


def next_step(results: StudyResults) -> str:
    """Recommend the next step in a sentence."""
    if results.findings:
        return tr(
            "Next: settle what was found in the recordings of {whose} (in the report: “Settle this first”) "
            "before any of their numbers is used.",
            whose=hands_text(dict.fromkeys(map(hand_of, results.findings))),
        )
    moved = [row for row in results.problems if row["kind"] == "receiver-moved"]
    if moved:
        return tr(
            "Next: record {tasks} of {whose} again: a receiver sat elsewhere there than in the calibration "
            "(in the report: “What went wrong”).",
            tasks=listed(dict.fromkeys(row["task"] for row in moved)),
            whose=hands_text(dict.fromkeys(map(hand_of, moved))),
        )
    steps = [*_modelling(results), *_moving(results), *_measuring(results)]
    if not steps:
        return tr("Next: see “What went wrong”.")
    best = max(steps, key=lambda step: step.gain_mm)
    least_mm = WORTH * min(layout.wanted_mm for layout in results.layouts.values())
    if best.gain_mm < least_mm:
        return tr(
            "Next: nothing is worth recording or measuring again; whatever it is, it would lower the mean "
            "error of the joints by less than {least_mm:g} mm. Leave joints that are not believed out of "
            "conclusions.",
            least_mm=least_mm,
        )
    return tr(
        "Next: {doing}. Of all that could be done that gains most: the mean error of the joints would fall "
        "from {before} to {after} mm.",
        doing=best.doing,
        before=number(best.before_mm),
        after=number(best.after_mm),
    )


def hands_text(hands: Iterable[Hand]) -> str:
    """Hands by name, of many the first ones."""
    hands = list(hands)
    names = [tr("{who}'s {hand} hand", who=own.who, hand=own.hand) for own in hands[:FEW_HANDS]]
    more = len(hands) - len(names)
    return listed([*names, *([tr("{more} more", more=more)] if more else [])])


def hands_counted(results: StudyResults, n: int) -> str:
    """So many hands, or sides of a body where a layout is of no hand."""
    return ngettext("{n} hand", "{n} hands", n) if results.of_hands else ngettext("{n} side", "{n} sides", n)


def _modelling(results: StudyResults) -> Iterator[Step]:
    """To let a model solve it that knows anatomy, where the leading one does not: what the recordings that
    are there then say stands in the advice, which is made so.
    """
    if results.fitted:
        return
    now = {
        (hand_of(row), row["joint"]): row["sd_mm"]
        for row in results.counted(results.joints)
        if row["model"] == results.leading and row["sd_mm"] is not None
    }
    pairs = [
        (now[key], row["sd_now_mm"])
        for row in results.counted(results.advice)
        if (key := (hand_of(row), row["joint"])) in now and row["sd_now_mm"] is not None
    ]
    if pairs:
        model = "whole-hand" if results.of_hands else "anatomical"
        before, after = zip(*pairs, strict=True)
        yield Step(tr("add {model} to the models of the study", model=model), mean(before), mean(after))


def _moving(results: StudyResults) -> Iterator[Step]:
    """To record the calibration again, those joints moving more that gain most by it."""
    of_hand: dict[Hand, list[Row]] = defaultdict(list)
    gains: dict[str, float] = defaultdict(float)
    for row in results.counted(results.advice):
        if row["sd_now_mm"] is not None:
            of_hand[hand_of(row)].append(row)
            gains[row["joint"]] += _gain_mm(row)
    if not of_hand:
        return
    most = max(gains.values())
    named = {joint for joint, gain in gains.items() if most > 0 and 2 * gain >= most}
    lacking = [h for h, rows in of_hand.items() if any(_gain_mm(r) > 0 for r in rows if r["joint"] in named)]
    before = [mean(row["sd_now_mm"] for row in rows) for rows in of_hand.values()]
    gained = [
        sum(_gain_mm(row) for row in rows if row["joint"] in named) / len(rows) for rows in of_hand.values()
    ]
    doing = tr(
        "let {joints} move more when calibrating{where}",
        joints=joints_text(joint for joint in gains if joint in named),
        where=_where(results, len(lacking), len(of_hand)),
    )
    yield Step(doing, mean(before), mean(before) - mean(gained))


def _gain_mm(row: Row) -> float:
    """By how much a joint's error would fall if it moved as advised; nothing where that is not advised."""
    if row["kind"] != MOVE or row["sd_moved_mm"] is None:
        return 0.0
    return max(0.0, float(row["sd_now_mm"] - row["sd_moved_mm"]))


def _measuring(results: StudyResults) -> Iterator[Step]:
    """To measure one more thing on every hand of which that is known, under the leading model."""
    of_hand: dict[Hand, dict[str, Row]] = defaultdict(dict)
    for row in results.counted(results.gains):
        if row["model"] == results.leading:
            of_hand[hand_of(row)][row["quantity"]] = row
    before = {hand: next(iter(rows.values()))["mean_sd_before_mm"] for hand, rows in of_hand.items()}
    for quantity in dict.fromkeys(quantity for rows in of_hand.values() for quantity in rows):
        own = {hand: rows[quantity] for hand, rows in of_hand.items() if quantity in rows}
        after = [own[hand]["mean_sd_after_mm"] if hand in own else before[hand] for hand in of_hand]
        row = next(iter(own.values()))
        doing = tr(
            "{doing}, to {sd_mm:.1f} mm{where}",
            doing=doing_text(row, asked=True),
            sd_mm=row["sd_mm"],
            where=_where(results, len(own), len(of_hand)),
        )
        yield Step(doing, mean(before.values()), mean(after))


def _where(results: StudyResults, n: int, of: int) -> str:
    """On how many of the hands that is to be done; empty where there is one hand."""
    return tr(" ({n} of {hands})", n=n, hands=hands_counted(results, of)) if of > 1 else ""
