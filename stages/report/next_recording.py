"""Before the next recording: which joints should move more, what one more measurement would gain, and what
fewer receivers would cost.
"""

from __future__ import annotations

from dataclasses import dataclass

from schemas.study import Hand
from stages.report.study_results import Row, StudyResults, hand_of
from stages.report.table_cells import Block, DataTable, Folded, counted, number

MOST_GAINS = 3

_TOUCH = "touch"
_PLACES = {
    "along": "how far along {} its receiver sits",
    "lateral": "how far to the side of {} its receiver sits",
    "height": "how high over {} its receiver sits",
    "distal": "how far from the next joint the receiver of {} sits",
}
"""Parts of a quantity that could be measured, as measurements.tsv calls them."""

_HEADER = ("Joint", "Range of motion [deg]", "SD now [mm]", "SD if it moved so [mm]", "What to do")


_FEWER_HEADER = (
    "Receivers in the task",
    "How many",
    "SD of centres [mm]",
    "SD of flexion [deg]",
    "Joint that loses most",
)


@dataclass(frozen=True)
class ModelGains:
    """What measuring would gain with one fitted model: a remark, and sentences, best first."""

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
    """What would make a hand's skeleton better."""
    rows = [row for row in results.advice if hand_of(row) == hand]
    lacking = [row for row in rows if not row["advice"].startswith("enough")]
    whose = str(hand)
    if not rows:
        remark = (
            "Whether its joints move enough could not be computed; the reason is under “What went wrong”."
        )
    elif lacking:
        remark = f"{len(lacking)} of {counted(len(rows), 'joint')} should move more."
    else:
        remark = f"All {counted(len(rows), 'joint')} move enough in the calibration recordings."
    return NextRecording(
        f"{hand.hand.capitalize()} hand",
        remark,
        _table(f"Joints that should move more: {whose}.", lacking) if lacking else None,
        Folded(f"All {counted(len(rows), 'joint')}", _table(f"Motion of every joint: {whose}.", rows))
        if rows
        else None,
        tuple(_gains(model, results.gains_of.get((hand, model), [])) for model in results.fitted),
        tuple(
            Folded(
                f"What a task would lose with fewer receivers, {model}",
                _fewer(f"A task with fewer receivers, {model}: {whose}.", costs),
            )
            for model in results.fitted
            if (costs := results.receiver_costs_of.get((hand, model)))
        ),
    )


def _fewer(caption: str, rows: list[Row]) -> DataTable:
    """What each receiver left out of a task would cost, and each smaller layout."""
    cells = tuple(
        (
            _worn_text(row),
            str(row["n_receivers"]),
            number(row["centre_sd_mm"]),
            number(row["flexion_sd_deg"]),
            f"{row['joint']}: {number(row['joint_centre_sd_mm'])} mm, "
            f"{number(row['joint_flexion_sd_deg'])} deg",
        )
        for row in rows
    )
    return DataTable(caption, (Block(_FEWER_HEADER, cells),), (), frozenset({0, 4}))


def _worn_text(row: Row) -> str:
    if row["layout"]:
        return f"layout {row['layout']}"
    return f"without {_bone_text(row['without'])}" if row["without"] else "all of the calibration"


def _table(caption: str, rows: list[Row]) -> DataTable:
    cells = tuple(
        (
            row["joint"],
            number(row["range_deg"], 0),
            number(row["sd_now_mm"]),
            number(row["sd_moved_mm"]),
            row["advice"],
        )
        for row in rows
    )
    return DataTable(caption, (Block(_HEADER, cells),), (), frozenset({0, 4}))


def _gains(model: str, rows: list[Row]) -> ModelGains:
    if not rows:
        return ModelGains(f"What one more measurement on the hand would gain with {model} is not known.", ())
    best = rows[:MOST_GAINS]
    remark = (
        f"What one more measurement on the hand would gain with {model}, the best {len(best)} of {len(rows)}:"
    )
    return ModelGains(remark, tuple(_sentence(row) for row in best))


def _sentence(row: Row) -> str:
    """One gain: what to measure, what that does to the joint that gains most and to all joints together."""
    name, _, part = row["quantity"].partition(".")
    if part == _TOUCH:
        doing = f"Touching a known point with the tip of {_digit_text(name)}"
    else:
        doing = "Measuring " + (_PLACES[part].format(_bone_text(name)) if part else _bone_text(name))
    joint = _joint_text(row["joint"], name.partition("_")[0])
    before, after = number(row["mean_sd_before_mm"]), number(row["mean_sd_after_mm"])
    return (
        f"{doing} to {row['sd_mm']:.1f} mm would take {joint} from {row['joint_sd_before_mm']:.1f} to "
        f"{row['joint_sd_after_mm']:.1f} mm (the mean of all joints from {before} to {after} mm)."
    )


def _digit_text(digit: str) -> str:
    return "the thumb" if digit == "thumb" else f"the {digit} finger"


def _bone_text(segment: str) -> str:
    digit, _, kind = segment.rpartition("_")
    if not digit:
        return f"the {segment}"
    return f"{_digit_text(digit)}'s {kind}{'' if kind == 'metacarpal' else ' phalanx'}"


def _joint_text(joint: str, of_digit: str) -> str:
    digit, _, kind = joint.rpartition("_")
    if not digit:
        return f"the {joint}"
    owner = "its" if digit == of_digit else f"{_digit_text(digit)}'s"
    return f"{owner} {kind.upper()}"
