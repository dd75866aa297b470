"""Tables of the skeleton itself: how far each joint can be trusted, and how long each bone is."""

from __future__ import annotations

from collections import Counter

from shukotsu.schemas.catalogue import DISTAL_RECEIVER
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
    by_bone: dict[str, dict[str, Row]] = {}
    for model in results.models:
        for name, row in _named_bones(results, hand, model).items():
            by_bone.setdefault(name, {})[model] = row
    order = {segment: index for index, segment in enumerate(results.layouts[hand].segments)}
    bones = sorted(by_bone, key=lambda name: order.get(name.split(" ")[0], len(order)))
    rows = tuple((bone, *(_length(by_bone[bone].get(model)) for model in results.models)) for bone in bones)
    return DataTable(
        tr("Bone lengths of {hand}, in mm, with 1-sigma error.", hand=hand),
        (Block((tr("Bone [mm]"), *results.models), rows),),
        _bone_notes(by_bone) if rows else (tr("No bone length was computed."),),
    )


def _named_bones(results: StudyResults, hand: Hand, model: str) -> dict[str, Row]:
    """Rows of bone_lengths by the bone's name, with its digit where several have one of that name."""
    uses = Counter(segment for digit in results.layouts[hand].digits.values() for segment in digit.segments)
    return {
        row["bone"] if uses[row["bone"]] < 2 else f"{row['bone']} ({word(row['digit'])})": row
        for row in results.bones_of.get((hand, model), [])
    }


def lengths_table(results: StudyResults, model: str) -> DataTable:
    """The bone lengths of all hands side by side, mm: a row a hand, a column a bone, with verdicts."""
    bones = {hand: _named_bones(results, hand, model) for hand in results.hands}
    order = {segment: i for layout in results.layouts.values() for i, segment in enumerate(layout.segments)}
    names = sorted(dict.fromkeys(name for own in bones.values() for name in own),
                   key=lambda name: order.get(name.split(" ")[0], len(order)))  # fmt: skip
    beliefs = {hand: {name: belief(row) for name, row in own.items()} for hand, own in bones.items()}
    rows = tuple(
        (
            anchor(link(hand.who.label, results.paths.report, results.paths.subject_page(*hand.who))),
            word(hand.hand),
            _believed(results, hand, beliefs[hand]),
            *(_believed_length(own.get(name), beliefs[hand].get(name, "")) for name in names),
        )
        for hand, own in bones.items()
    )
    header = (tr("Subject"), tr("Hand"), tr("Lengths to believe"))
    return DataTable(
        tr("Bone lengths of every hand under {model}, in mm, with 1-sigma error.", model=model),
        (Block((*header, *(word(name).replace("_", " ") for name in names)), rows if names else ()),),
        _lengths_notes(results, model) if names else (tr("No bone length was computed."),),
        frozenset(range(2)),
    )


def _believed(results: StudyResults, hand: Hand, beliefs: dict[str, str]) -> str:
    """Count how many of a hand's lengths to believe; none of one with a finding."""
    if not beliefs:
        return DASH
    yes = 0 if hand in results.suspect else sum(own == BELIEVED for own in beliefs.values())
    text = tr("{n_far} of {n_rows}", n_far=yes, n_rows=len(beliefs))
    return text + (tr(" (◆ has a finding)") if hand in results.suspect else "")


def _believed_length(row: Row | None, believed: str) -> str:
    """The length, a doubt's sign behind it, so that it sorts as a number."""
    if row is None or row["length_mm"] is None:
        return DASH
    sd = "" if row["sd_mm"] is None else f" ± {number(row['sd_mm'], 1)}"
    return number(row["length_mm"], 1) + sd + ("" if believed == BELIEVED else f" {believed[0]}")


def _lengths_notes(results: StudyResults, model: str) -> tuple[str, ...]:
    """Explain the signs, and what of the model's lengths is not the bone itself."""
    rows = [row for hand in results.hands for row in results.bones_of.get((hand, model), [])]
    notes = [
        tr("◆ with care, ✕ not to believe: the worst of the joints at the bone's ends and of its own error.")
    ]
    if any(row["ends_at"] == DISTAL_RECEIVER for row in rows):
        notes.append(
            tr(
                "{model} ends a digit at its distal receiver and may begin a finger at the wrist; such a "
                "length is not the bone's and is with care at best.",
                model=model,
            )
        )
    if model in results.fitted:
        notes.append(
            tr(
                "Where {model} shares lengths between a person's hands, the two are not independent.",
                model=model,
            )
        )
    return tuple(notes)


def receiver_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """Tabulate where the receivers of a hand sit on their bones, for each model that fits the whole hand."""
    folded = []
    for model in results.fitted:
        rows = results.receivers_of.get((hand, model), [])
        caption = tr("Receivers of {hand}, model {model}, with 1-sigma errors.", hand=hand, model=model)
        no_hand = tr("No hand was fitted; the reason is under “What went wrong”.")
        table = table_of(caption, _RECEIVER_COLUMNS, rows, no_hand)
        counted = ngettext("{n} receiver", "{n} receivers", len(rows))
        counts = _counts(rows, counted, tr("no hand was fitted"))
        summary = tr("{hand} hand, {model}: {counts}", hand=title(hand.hand), model=model, counts=counts)
        folded.append(Folded(summary, table))
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


def _counts(rows: list[Row], counted: str, nothing: str) -> str:
    if not rows:
        return nothing
    statuses = Counter(row["status"] for row in rows)
    loose = sum(row.get("loose_from_frame") is not None for row in rows)
    doubts = [
        tr("{count} {status}", count=statuses[kind], status=kind)
        for kind in ("weak", "failed")
        if statuses[kind]
    ]
    doubts += [tr("{loose} came loose", loose=loose)] if loose else []
    return ", ".join([counted, *(doubts or [tr("all ok")])])


def _length(row: Row | None) -> str:
    if row is None or row["length_mm"] is None:
        return DASH
    varies = row["sd_over_frames_mm"]
    return _with_error(row["length_mm"], row["sd_mm"]) + (
        "" if varies is None else tr(" (varies {varies})", varies=number(varies))
    )


def _bone_notes(by_bone: dict[str, dict[str, Row]]) -> tuple[str, ...]:
    """Explain “varies” where it is shown, and give every message once, with the bones and models it is of."""
    places: dict[str, list[str]] = {}
    varies = False
    for bone, by_model in by_bone.items():
        for model, row in by_model.items():
            varies = varies or row["sd_over_frames_mm"] is not None
            if row["message"]:
                places.setdefault(translated(row["message"]).rstrip(".。"), []).append(f"{bone} ({model})")
    notes = [f"{', '.join(where)}: {message}." for message, where in places.items()]
    if varies:
        notes.append(
            tr(
                "“varies”: standard deviation over the frames of a metacarpal's length, from its base to "
                "the MCP joint. A true skeleton keeps it near 0."
            )
        )
    return tuple(notes)
