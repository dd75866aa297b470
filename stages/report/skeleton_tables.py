"""Tables of the skeleton itself: how long each bone is, and where the receivers sit."""

from __future__ import annotations

from collections import Counter

from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import N_, ngettext, tr, translated, word
from shukotsu.stages.report.belief import BELIEVED, belief
from shukotsu.stages.report.links import anchor, link
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import (
    DASH,
    Block,
    Column,
    DataTable,
    Folded,
    number,
    number_column,
    table_of,
    text_column,
    title,
)

STATUS_MARKS = {"ok": N_("ok"), "weak": N_("◆ weak"), "failed": N_("✕ failed")}

STATUS = Column(
    "Status", lambda row: tr(STATUS_MARKS.get(str(row["status"]), str(row["status"]))), is_text=True
)


def bone_table(results: StudyResults, hand: Hand) -> DataTable:
    """The bone lengths of a hand, mm, one column a model; a bone is named after its segment."""
    of_models = {model: _named_bones(results, hand, model) for model in results.models}
    names = _in_order(results, {name for bones in of_models.values() for name in bones})
    rows = tuple((name, *(_length(bones.get(name)) for bones in of_models.values())) for name in names)
    messages = {
        translated(row["message"]): None
        for bones in of_models.values()
        for row in bones.values()
        if row["message"]
    }
    return DataTable(
        tr("Bone lengths of {hand}, in mm, with 1-sigma error.", hand=hand),
        (Block((tr("Bone [mm]"), *results.models), rows),),
        tuple(messages) if rows else (tr("No bone length was computed."),),
    )


def lengths_table(results: StudyResults, model: str) -> DataTable:
    """The bone lengths of all hands side by side, mm: a row a hand, a column a bone, with verdicts."""
    of_hands = {hand: _named_bones(results, hand, model) for hand in results.hands}
    names = _in_order(results, {name for bones in of_hands.values() for name in bones})
    rows = tuple(
        (
            anchor(link(hand.who.label, results.paths.report, results.paths.subject_page(*hand.who))),
            word(hand.hand),
            _believed(results, hand, bones),
            *(_believed_length(bones.get(name)) for name in names),
        )
        for hand, bones in of_hands.items()
    )
    header = (tr("Subject"), tr("Hand"), tr("Lengths to believe"))
    return DataTable(
        tr("Bone lengths of every hand under {model}, in mm, with 1-sigma error.", model=model),
        (Block((*header, *(word(name).replace("_", " ") for name in names)), rows if names else ()),),
        () if names else (tr("No bone length was computed."),),
        frozenset(range(2)),
    )


def _named_bones(results: StudyResults, hand: Hand, model: str) -> dict[str, Row]:
    """Rows of bone_lengths by the bone's name, with its digit where several have one of that name."""
    uses = Counter(segment for digit in results.layouts[hand].digits.values() for segment in digit.segments)
    return {
        row["bone"] if uses[row["bone"]] < 2 else f"{row['bone']} ({word(row['digit'])})": row
        for row in results.bones_of.get((hand, model), [])
    }


def _in_order(results: StudyResults, names: set[str]) -> list[str]:
    """Names of bones in the order of the layouts' segments."""
    order = {segment: i for layout in results.layouts.values() for i, segment in enumerate(layout.segments)}
    return sorted(names, key=lambda name: (order.get(name.split(" ")[0], len(order)), name))


def _believed(results: StudyResults, hand: Hand, bones: dict[str, Row]) -> str:
    """How many of a hand's lengths to believe; none of one with a finding."""
    if not bones:
        return DASH
    suspect = hand in results.suspect
    count = 0 if suspect else sum(belief(row) == BELIEVED for row in bones.values())
    text = tr("{n_far} of {n_rows}", n_far=count, n_rows=len(bones))
    return text + (tr(" (◆ has a finding)") if suspect else "")


def _believed_length(row: Row | None) -> str:
    """The length, a doubt's sign behind it."""
    if row is None or row["length_mm"] is None:
        return DASH
    sd = "" if row["sd_mm"] is None else f" ± {number(row['sd_mm'], 1)}"
    verdict = belief(row)
    return number(row["length_mm"], 1) + sd + ("" if verdict == BELIEVED else f" {verdict[0]}")


def _length(row: Row | None) -> str:
    if row is None or row["length_mm"] is None:
        return DASH
    varies = row["sd_over_frames_mm"]
    text = _with_error(row["length_mm"], row["sd_mm"])
    return text + ("" if varies is None else tr(" (varies {varies})", varies=number(varies)))


def receiver_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """Where the receivers of a hand sit on their bones, for each model that fits the whole hand."""
    folded = []
    for model in results.fitted:
        rows = results.receivers_of.get((hand, model), [])
        caption = tr("Receivers of {hand}, model {model}, with 1-sigma errors.", hand=hand, model=model)
        table = table_of(caption, _RECEIVER_COLUMNS, rows, tr("no hand was fitted"))
        loose = sum(row["loose_from_frame"] is not None for row in rows)
        counts = ngettext("{n} receiver", "{n} receivers", len(rows))
        counts += tr(", {loose} came loose", loose=loose) if loose else ""
        folded.append(
            Folded(
                tr("{hand} hand, {model}: {counts}", hand=title(hand.hand), model=model, counts=counts), table
            )
        )
    return folded


def _loose(row: Row) -> str:
    if row["loose_from_frame"] is None:
        return ""
    where = tr(" of {loose_task}", loose_task=row["loose_task"]) if row["loose_task"] else ""
    return tr(
        "◆ from frame {loose_from_frame}{where}: moved {loose_shift_mm} mm, turned {loose_turn_deg} deg",
        loose_from_frame=row["loose_from_frame"],
        where=where,
        loose_shift_mm=number(row["loose_shift_mm"], 1),
        loose_turn_deg=number(row["loose_turn_deg"], 1),
    )


def _placed(heading: str, name: str) -> Column:
    return Column(heading, lambda row: _with_error(row[f"{name}_mm"], row[f"{name}_sd_mm"]))


_RECEIVER_COLUMNS = (
    text_column(N_("Receiver"), "segment"),
    STATUS,
    _placed(N_("Along the bone [mm]"), "along"),
    _placed(N_("To the thumb's side [mm]"), "lateral"),
    _placed(N_("Over the bone [mm]"), "height"),
    number_column(N_("Residual [mm]"), "residual_mm"),
    number_column(N_("Residual [deg]"), "residual_deg"),
    Column(N_("Came loose"), _loose, is_text=True),
    text_column(N_("Message"), "message"),
)


def _with_error(value: float | None, sd: float | None) -> str:
    return number(value) + (f" ± {number(sd)}" if value is not None and sd is not None else "")
