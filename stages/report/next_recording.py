"""Before the next recording: which joints should move more, what one more measurement would gain, and what
fewer receivers would cost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import mean

from shukotsu.schemas.advice import MOVE, NOTHING_TO_DO, advice_text
from shukotsu.schemas.findings import values_of
from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import N_, ngettext, tr
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import Block, DataTable, Folded, number

MOST_GAINS = 3

_TOUCH = "touch"
_PLACES = {
    "along": N_("how far along {bone} its receiver sits"),
    "lateral": N_("how far to the side of {bone} its receiver sits"),
    "height": N_("how high over {bone} its receiver sits"),
    "distal": N_("how far from the next joint the receiver of {bone} sits"),
}
"""Parts of a quantity that could be measured, as measurements.tsv calls them."""

_HEADER = (
    N_("Joint"),
    N_("Receivers turned [deg]"),
    N_("SD now [mm]"),
    N_("SD if it moved so [mm]"),
    N_("What to do"),
)


_FEWER_HEADER = (
    N_("Receivers in the task"),
    N_("How many"),
    N_("SD of centres [mm]"),
    N_("SD of flexion [deg]"),
    N_("Joint that loses most"),
)


@dataclass(frozen=True)
class ModelGains:
    """Hold what measuring would gain with one fitted model: a remark, and sentences, best first."""

    remark: str
    sentences: tuple[str, ...]


@dataclass(frozen=True)
class NextRecording:
    """One hand: joints that should move more (None where none should), all joints folded, measurements, and
    what a task with fewer receivers would lose, a table a fitted model.
    """

    hand: str
    remark: str
    to_move: DataTable | None
    every_joint: Folded | None
    measure: tuple[ModelGains, ...]
    fewer: tuple[Folded, ...]


def next_recording(results: StudyResults, hand: Hand) -> NextRecording:
    """Describe what would make a hand's skeleton better."""
    rows = [row for row in results.advice if hand_of(row) == hand]
    lacking = [row for row in rows if row["kind"] == MOVE]
    stuck = [row for row in rows if row["kind"] not in (MOVE, *NOTHING_TO_DO)]
    whose = tr("{hand}", hand=hand)
    if not rows:
        remark = tr(
            "Whether its joints move enough could not be computed; the reason is under “What went wrong”."
        )
    elif lacking:
        remark = tr(
            "{n_lacking} of {joints} should move more.",
            n_lacking=len(lacking),
            joints=ngettext("{n} joint", "{n} joints", len(rows)),
        )
    elif not stuck:
        remark = tr(
            "All {joints} move enough in the calibration recordings.",
            joints=ngettext("{n} joint", "{n} joints", len(rows)),
        )
    else:
        remark = ""
    if stuck:
        remark += " " * bool(remark) + tr(
            "Of {n_stuck} of {joints} more movement says nothing; what to look at stands beside each.",
            n_stuck=len(stuck),
            joints=ngettext("{n} joint", "{n} joints", len(rows)),
        )
    return NextRecording(
        tr("{hand} hand", hand=hand.hand.capitalize()),
        remark,
        _table(tr("Joints that should move more: {whose}.", whose=whose), lacking) if lacking else None,
        Folded(
            tr("All {joints}", joints=ngettext("{n} joint", "{n} joints", len(rows))),
            _table(tr("Motion of every joint: {whose}.", whose=whose), rows),
        )
        if rows
        else None,
        tuple(
            _gains(
                model, results.gains_of.get((hand, model), []), results.receivers_of.get((hand, model), [])
            )
            for model in results.fitted
        ),
        tuple(
            Folded(
                tr("What a task would lose with fewer receivers, {model}", model=model),
                _fewer(tr("A task with fewer receivers, {model}: {whose}.", model=model, whose=whose), costs),
            )
            for model in results.fitted
            if (costs := results.receiver_costs_of.get((hand, model)))
        ),
    )


def _fewer(caption: str, rows: list[Row]) -> DataTable:
    """Tabulate the cost of each receiver left out of a task, and of each smaller layout."""
    cells = tuple(
        (
            _worn_text(row),
            str(row["n_receivers"]),
            number(row["centre_sd_mm"]),
            number(row["flexion_sd_deg"]),
            tr(
                "{joint}: {joint_centre_sd_mm} mm, {joint_flexion_sd_deg} deg",
                joint=row["joint"],
                joint_centre_sd_mm=number(row["joint_centre_sd_mm"]),
                joint_flexion_sd_deg=number(row["joint_flexion_sd_deg"]),
            ),
        )
        for row in rows
    )
    return DataTable(caption, (Block(_FEWER_HEADER, cells),), (), frozenset({0, 4}))


def _worn_text(row: Row) -> str:
    if row["layout"]:
        return tr("layout {layout}", layout=row["layout"])
    return (
        tr("without {bone_text}", bone_text=_bone_text(row["without"]))
        if row["without"]
        else tr("all of the calibration")
    )


def _table(caption: str, rows: list[Row]) -> DataTable:
    cells = tuple(
        (
            row["joint"],
            number(row["range_deg"], 0),
            number(row["sd_now_mm"]),
            number(row["sd_moved_mm"]),
            advice_text(row["joint"], row["kind"], values_of(row["values"])),
        )
        for row in rows
    )
    return DataTable(caption, (Block(_HEADER, cells),), (), frozenset({0, 4}))


def _gains(model: str, rows: list[Row], receivers: list[Row]) -> ModelGains:
    if not rows:
        return ModelGains(
            tr("What one more measurement on the hand would gain with {model} is not known.", model=model),
            (),
        )
    best = rows[:MOST_GAINS]
    remark = tr(
        "What one more measurement on the hand would gain with {model}, the best {n_best} of {n_rows}:",
        model=model,
        n_best=len(best),
        n_rows=len(rows),
    )
    return ModelGains(remark, (*map(_sentence, best), *_of_fingertips(receivers)))


def _of_fingertips(receivers: list[Row]) -> Iterator[str]:
    """Say what would make fingertips better, whose error no joint's tells."""
    sd_mm = [row["soft_tip_sd_mm"] for row in receivers if row["soft_tip_sd_mm"] is not None]
    if sd_mm:
        yield tr(
            "Fingertips are known to {sd_mm} mm. Where they matter, one touch of each on a known point is "
            "the cheapest next step.",
            sd_mm=number(mean(sd_mm)),
        )


def _sentence(row: Row) -> str:
    """One gain: what to measure, what that does to the joint that gains most and to all joints together."""
    joint = _joint_text(row["joint"], row["quantity"].partition(".")[0].partition("_")[0])
    before, after = number(row["mean_sd_before_mm"]), number(row["mean_sd_after_mm"])
    return tr(
        "{doing} to {sd_mm:.1f} mm would take {joint} from {joint_sd_before_mm:.1f} to "
        "{joint_sd_after_mm:.1f} mm (the mean of all joints from {before} to {after} mm).",
        doing=doing_text(row),
        sd_mm=row["sd_mm"],
        joint=joint,
        joint_sd_before_mm=row["joint_sd_before_mm"],
        joint_sd_after_mm=row["joint_sd_after_mm"],
        before=before,
        after=after,
    )


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
