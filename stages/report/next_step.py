"""What to record or measure next, by the table gains: of a study in a sentence, of a hand in three lines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from statistics import mean

from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import N_, listed, ngettext, tr
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import number

WORTH = 0.03
"""By this share of what the study asks of a centre a thing must lower the mean error to be worth doing."""

FEW_HANDS = 3
"""So many hands are named, of more the rest is counted."""

MOST_GAINS = 3

_TOUCH = "touch"
_PLACES = {
    "along": N_("how far along {bone} its receiver sits"),
    "lateral": N_("how far to the side of {bone} its receiver sits"),
    "height": N_("how high over {bone} its receiver sits"),
    "distal": N_("how far from the next joint the receiver of {bone} sits"),
}
"""Parts of a quantity that could be measured, as measurements.tsv calls them."""


def next_step(results: StudyResults) -> str:
    """Recommend the next step in a sentence; empty where no hand is fitted that could tell."""
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
    if not results.fitted:
        return tr("Next: add {model} to the models of the study.", model="whole-hand") * results.of_hands
    before: dict[Hand, float] = {}
    gained: dict[str, list[float]] = defaultdict(list)
    rows = [row for row in results.counted(results.gains) if row["model"] == results.leading]
    for row in rows:
        before[hand_of(row)] = row["mean_sd_before_mm"]
        gained[row["quantity"]].append(row["mean_sd_before_mm"] - row["mean_sd_after_mm"])
    if not rows:
        return tr("Next: see “What went wrong”.")
    best = max(gained, key=lambda quantity: sum(gained[quantity]))
    before_mm, gain_mm = mean(before.values()), sum(gained[best]) / len(before)
    least_mm = WORTH * min(layout.wanted_mm for layout in results.layouts.values())
    if gain_mm < least_mm:
        return tr(
            "Next: nothing is worth recording or measuring again; whatever it is, it would lower the mean "
            "error of the joints by less than {least_mm:g} mm. Leave joints that are not believed out of "
            "conclusions.",
            least_mm=least_mm,
        )
    n, hands = len(gained[best]), hands_counted(results, len(before))
    row = next(row for row in rows if row["quantity"] == best)
    doing = tr(
        "{doing}, to {sd_mm:.1f} mm{where}",
        doing=doing_text(row, asked=True),
        sd_mm=row["sd_mm"],
        where=tr(" ({n} of {hands})", n=n, hands=hands) if len(before) > 1 else "",
    )
    return tr(
        "Next: {doing}. Of all that could be done that gains most: the mean error of the joints would fall "
        "from {before} to {after} mm.",
        doing=doing,
        before=number(before_mm),
        after=number(before_mm - gain_mm),
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


def gain_lines(rows: Sequence[Row]) -> list[str]:
    """Return what the best of a hand's rows of gains would do, a sentence each, at most three."""
    return [
        tr(
            "{doing} to {sd_mm:.1f} mm would take {joint} from {joint_sd_before_mm:.1f} to "
            "{joint_sd_after_mm:.1f} mm (the mean of all joints from {before} to {after} mm).",
            doing=doing_text(row),
            sd_mm=row["sd_mm"],
            joint=_joint_text(row["joint"], row["quantity"].partition(".")[0].partition("_")[0]),
            joint_sd_before_mm=row["joint_sd_before_mm"],
            joint_sd_after_mm=row["joint_sd_after_mm"],
            before=number(row["mean_sd_before_mm"]),
            after=number(row["mean_sd_after_mm"]),
        )
        for row in rows[:MOST_GAINS]
    ]


def doing_text(row: Row, *, asked: bool = False) -> str:
    """Describe the action of a row of gains; asked : as something to do, not as something done."""
    name, _, part = row["quantity"].partition(".")
    if part == _TOUCH:
        touch = (
            N_("touch a known point with the tip of {digit_text}")
            if asked
            else N_("Touching a known point with the tip of {digit_text}")
        )
        return tr(touch, digit_text=_digit_text(name))
    what = tr(_PLACES[part], bone=_bone_text(name)) if part else _bone_text(name)
    return tr("measure {what}", what=what) if asked else tr("Measuring {what}", what=what)


def _digit_text(digit: str) -> str:
    return tr("the thumb") if digit == "thumb" else tr("the {digit} finger", digit=digit)


def _bone_text(segment: str) -> str:
    digit, _, kind = segment.rpartition("_")
    if not digit:
        return tr("the {segment}", segment=segment)
    bone = kind if kind == "metacarpal" else f"{kind} phalanx"
    return tr("{owner}'s {segment}", owner=_digit_text(digit), segment=bone)


def _joint_text(joint: str, of_digit: str) -> str:
    digit, _, kind = joint.rpartition("_")
    if not digit:
        return tr("the {joint}", joint=joint)
    owner = tr("its") if digit == of_digit else tr("{owner}'s", owner=_digit_text(digit))
    return tr("{owner} {joint}", owner=owner, joint=kind.upper())
