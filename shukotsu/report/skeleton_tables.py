"""Tables of a hand: bone lengths, positions of receivers on their bones, and ranges of motion."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from shukotsu.report import table_cells
from shukotsu.report.belief import BELIEVED, NO_JOINT, belief
from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import DASH, DataTable, Folded, PageColumn, RowBlock, number, title
from shukotsu.scores.agreement import times_expected
from shukotsu.study.findings import title_of
from shukotsu.tables.subjects import Hand, path_token
from shukotsu.translation import N_, ngettext, tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, RangesOfMotionRow, ReceiversRow

SHARED = N_("The model estimates the bone lengths of both hands together: they are not independent.")
_STATUS = {"ok": "✓", "weak": "◆", "failed": "✕"}


def bone_table(results: StudyResults, hand: Hand) -> DataTable:
    """Return a table of a hand's bone lengths, mm, one column per model; bones are named by segment."""
    of_models = {model: _named_bones(results, hand, model) for model in results.models}
    names = _in_order(results, {name for bones in of_models.values() for name in bones})
    rows = tuple((name, *(_length(bones.get(name)) for bones in of_models.values())) for name in names)
    noted = [row["message"] for bones in of_models.values() for row in bones.values() if row["message"]]
    messages = dict.fromkeys(map(translated, noted))
    return DataTable(
        tr("Bone lengths [mm] with 1-sigma error: {name}.", name=hand),
        (RowBlock((table_cells.heading("length_mm"), *results.models), rows),),
        tuple(messages) if rows else (tr("No bone length was computed."),),
        source="bone_lengths",
    )


def lengths_table(results: StudyResults, model: str) -> DataTable:
    """Return a table of bone lengths, mm: a row per hand, a column per bone, with verdicts."""
    of_hands = {hand: _named_bones(results, hand, model) for hand in results.hands}
    names = _in_order(results, {name for bones in of_hands.values() for name in bones})
    rows, page = [], results.paths.report
    for hand, bones in of_hands.items():
        to = table_cells.link(hand.who.label, page, results.paths.subject_page(*hand.who))
        lengths = [_length(bones.get(name)) for name in names]
        believed = _count_believed(results, hand, bones)
        rows.append((table_cells.anchor(to), word(hand.hand), believed, *lengths))
    shared = (tr(SHARED),) if lengths_are_shared(results, results.hands, model) else ()
    bones_in_words = [word(name).replace("_", " ") for name in names]
    header = (tr("Subject"), tr("Hand"), tr("Believed"), *bones_in_words)
    return DataTable(
        tr("Bone lengths [mm] with 1-sigma error: {name}.", name=model),
        (RowBlock(header, tuple(rows) if names else ()),),
        (*shared, *agreement_notes(results, model)) if names else (tr("No bone length was computed."),),
        frozenset(range(2)),
        "bone_lengths",
    )


_KNOWN_TWICE = {
    "session": N_("Bone lengths from two sessions differ by {times} times the expected amount ({n} pairs)."),
    "hand": N_("Bone lengths of the two hands differ by {times} times the expected amount ({n} pairs)."),
    "recording": N_(
        "Bone lengths from two recordings of a session differ by {times} times the expected amount ({n} "
        "pairs)."
    ),
}


def agreement_notes(results: StudyResults, model: str) -> tuple[str, ...]:
    """Return sentences on how far two estimates of the same bone differ, relative to what is expected."""
    times = times_expected(row for row in results.rows.agreement if row["model"] == model)
    notes = [tr(_KNOWN_TWICE[across], times=number(t, 1), n=n) for across, (t, n) in times.items()]
    if notes:
        notes.append(
            tr(
                "A factor of 1 is expected if the stated errors are correct. Errors that are the same each "
                "time, from the average anatomy or from this person's skin, do not show in these comparisons."
            )
        )
    return tuple(notes)


def lengths_are_shared(results: StudyResults, hands: Sequence[Hand], model: str) -> bool:
    """Return whether the model shares bone lengths between two of these hands that are of the same person."""
    fitting = results.models[model].fitting
    return fitting is not None and fitting.share_lengths and len({hand.who for hand in hands}) < len(hands)


def _named_bones(results: StudyResults, hand: Hand, model: str) -> dict[str, BoneLengthsRow]:
    """Return rows of bone_lengths by bone, with the digit in the name if several digits have the bone."""
    uses = Counter(segment for digit in results.layouts[hand].digits.values() for segment in digit.segments)
    return {
        row["bone"] if uses[row["bone"]] < 2 else f"{row['bone']} ({word(row['digit'])})": row
        for row in results.bones_of.get((hand, model), [])
    }


def _in_order(results: StudyResults, names: set[str]) -> list[str]:
    """Return names of bones in the order of the layouts' segments."""
    order = {segment: i for layout in results.layouts.values() for i, segment in enumerate(layout.segments)}
    return sorted(names, key=lambda name: (order.get(name.split(" ")[0], len(order)), name))


def _count_believed(results: StudyResults, hand: Hand, bones: dict[str, BoneLengthsRow]) -> str:
    """Return how many of a hand's lengths are believed, which is none for a suspect hand."""
    if not bones:
        return DASH
    suspect = hand in results.suspect
    count = 0 if suspect else sum(belief(row) == BELIEVED for row in bones.values())
    return tr("{n} of {total}", n=count, total=len(bones)) + (" ◆" if suspect else "")


def _length(row: BoneLengthsRow | None) -> str:
    """Return the length with its error, followed by the sign of its verdict if it is not believed."""
    if row is None or row["length_mm"] is None:
        return DASH
    verdict = belief(row)
    sign = "" if verdict == BELIEVED else f" {verdict[0]}"
    return table_cells.with_error(row["length_mm"], row["sd_mm"], 1) + sign


def receiver_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """Return a table of the receivers' positions on a hand's bones, by model that fits the whole hand."""
    columns = (
        table_cells.text_column(tr("Receiver"), "segment"),
        PageColumn(tr("Status"), lambda row: _STATUS[row["status"]], is_text=True),
        table_cells.error_column(tr("Along the bone [mm]"), "along", "mm", 2),
        table_cells.error_column(tr("To the thumb's side [mm]"), "lateral", "mm", 2),
        table_cells.error_column(tr("Above the bone [mm]"), "height", "mm", 2),
        table_cells.quantity_column("residual_mm"),
        table_cells.quantity_column("residual_deg"),
        PageColumn(tr("Came loose"), _loose, is_text=True),
        table_cells.text_column(tr("Message"), "message"),
    )
    folded = []
    for model in results.fitted:
        rows = results.receivers_of.get((hand, model), [])
        counts = ngettext("{n} receiver", "{n} receivers", len(rows))
        summary = tr("{hand} hand", hand=title(hand.hand)) + f", {model}: {counts}"
        source = f"fits/{hand.hand}/{path_token(model)}/receivers"
        table = table_cells.table_of(summary, columns, rows, tr(NO_JOINT), source=source)
        folded.append(Folded(summary, table))
    return folded


def _loose(row: ReceiversRow) -> str:
    if row["loose_from_frame"] is None:
        return ""
    text = N_("◆ {task} from frame {frame} on: moved {mm} mm, rotated {deg} deg")
    mm, deg = number(row["loose_shift_mm"], 1), number(row["loose_turn_deg"], 1)
    loose = tr(text, task=row["loose_task"], frame=row["loose_from_frame"], mm=mm, deg=deg)
    return loose.replace("◆  ", "◆ ")


def measured_table(name: str, rows: list[RangesOfMotionRow], *, with_recording: bool) -> DataTable:
    """Return a table of range, posture and speed of every joint angle, with 1-sigma errors of the ranges.

    name : the hand or the model, for the caption. Rows without numbers have their reason.
    """
    failed = any(row["status"] == "failed" for row in rows)
    reason = PageColumn(
        tr("Message"),
        lambda row: translated(row["message"]) if row["status"] == "failed" else "",
        is_text=True,
    )
    caption = tr("Range of motion, posture and speed, with 1-sigma errors: {name}.", name=name)
    task = PageColumn(tr("Task"), title_of, is_text=True)
    columns = (
        table_cells.text_column(tr("Joint"), "joint"),
        table_cells.text_column(tr("Angle"), "angle"),
        *((task,) if with_recording else ()),
        table_cells.error_column(f"{tr('Range of motion')} [deg]", "range", "deg"),
        *map(table_cells.quantity_column, ("low_deg", "high_deg", "full_range_deg")),
        table_cells.error_column(f"{tr('Median')} [deg]", "median", "deg"),
        *map(table_cells.quantity_column, ("speed_median_deg_s", "speed_p95_deg_s", "valid_percent")),
        *((reason,) if failed else ()),
    )
    return table_cells.table_of(caption, columns, rows, source="ranges_of_motion")
