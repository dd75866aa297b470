"""What to record or measure next, by the table gains: of a hand in three lines."""

from __future__ import annotations

from collections.abc import Sequence

from shukotsu.sentences.translation import N_, tr
from shukotsu.stages.report.study_results import Row
from shukotsu.stages.report.table_cells import number

MOST_GAINS = 3

_TOUCH = "touch"
_PLACES = {
    "along": N_("how far along {bone} its receiver sits"),
    "lateral": N_("how far to the side of {bone} its receiver sits"),
    "height": N_("how high over {bone} its receiver sits"),
    "distal": N_("how far from the next joint the receiver of {bone} sits"),
}
"""Parts of a quantity that could be measured, as measurements.tsv calls them."""


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
