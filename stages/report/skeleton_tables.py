"""Tables of the skeleton itself: how far each joint can be trusted, and how long each bone is."""

from __future__ import annotations

from collections import Counter

from schemas.study import Hand
from stages.report.study_results import Row, StudyResults
from stages.report.table_cells import (
    DASH,
    Block,
    Column,
    DataTable,
    Folded,
    counted,
    number,
    number_column,
    table_of,
    text_column,
    title,
)
from stages.report.wording import mark, say, told, word

STATUS_MARKS = {"ok": mark("ok"), "weak": mark("◆ weak"), "failed": mark("✕ failed")}

STATUS = Column(
    "Status", lambda row: say(STATUS_MARKS.get(str(row["status"]), str(row["status"]))), is_text=True
)


def bone_table(results: StudyResults, hand: Hand) -> DataTable:
    """The bone lengths of a hand, mm, one column a model; a bone is named after its segment."""
    by_bone: dict[str, dict[str, Row]] = {}
    uses = Counter(segment for digit in results.layouts[hand].digits.values() for segment in digit.segments)
    for model in results.models:
        for row in results.bones_of.get((hand, model), []):
            name = row["bone"] if uses[row["bone"]] < 2 else f"{row['bone']} ({word(row['digit'])})"
            by_bone.setdefault(name, {})[model] = row
    order = {segment: index for index, segment in enumerate(results.layouts[hand].segments)}
    bones = sorted(by_bone, key=lambda name: order.get(name.split(" ")[0], len(order)))
    rows = tuple((bone, *(_length(by_bone[bone].get(model)) for model in results.models)) for bone in bones)
    return DataTable(
        say("Bone lengths of {hand}, in mm, with 1-sigma error.", hand=hand),
        (Block((say("Bone [mm]"), *results.models), rows),),
        _bone_notes(by_bone) if rows else (say("No bone length was computed."),),
    )


def receiver_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """Where the receivers of a hand sit on their bones: one table for each model that fits the whole hand."""
    folded = []
    for model in results.fitted:
        rows = results.receivers_of.get((hand, model), [])
        caption = say("Receivers of {hand}, model {model}, with 1-sigma errors.", hand=hand, model=model)
        no_hand = say("No hand was fitted; the reason is under “What went wrong”.")
        table = table_of(caption, _RECEIVER_COLUMNS, rows, no_hand)
        folded.append(
            Folded(
                say(
                    "{hand} hand, {model}: {counts}",
                    hand=title(hand.hand),
                    model=model,
                    counts=_counts(rows, "receiver", say("no hand was fitted")),
                ),
                table,
            )
        )
    return folded


def _loose(row: Row) -> str:
    if row["loose_from_frame"] is None:
        return ""
    where = say(" of {loose_task}", loose_task=row["loose_task"]) if row["loose_task"] else ""
    return say(
        ("◆ from frame {loose_from_frame}{where}: moved {loose_shift_mm} mm, turned {loose_turn_deg} deg"),
        loose_from_frame=row["loose_from_frame"],
        where=where,
        loose_shift_mm=number(row["loose_shift_mm"], 1),
        loose_turn_deg=number(row["loose_turn_deg"], 1),
    )


def _placed(heading: str, name: str) -> Column:
    return Column(heading, lambda row: _with_error(row[f"{name}_mm"], row[f"{name}_sd_mm"]))


_RECEIVER_COLUMNS = (
    text_column(mark("Receiver"), "segment"),
    STATUS,
    _placed(mark("Along the bone [mm]"), "along"),
    _placed(mark("To the thumb's side [mm]"), "lateral"),
    _placed(mark("Over the bone [mm]"), "height"),
    number_column(mark("Residual [mm]"), "residual_mm"),
    number_column(mark("Residual [deg]"), "residual_deg"),
    Column(mark("Came loose"), _loose, is_text=True),
    text_column(mark("Message"), "message"),
)


def _with_error(value: float | None, sd: float | None) -> str:
    return number(value) + (f" ± {number(sd)}" if value is not None and sd is not None else "")


def _counts(rows: list[Row], word: str, nothing: str) -> str:
    if not rows:
        return nothing
    statuses = Counter(row["status"] for row in rows)
    loose = sum(row.get("loose_from_frame") is not None for row in rows)
    doubts = [
        say("{count} {status}", count=statuses[kind], status=kind)
        for kind in ("weak", "failed")
        if statuses[kind]
    ]
    doubts += [say("{loose} came loose", loose=loose)] if loose else []
    return ", ".join([counted(len(rows), word), *(doubts or [say("all ok")])])


def _length(row: Row | None) -> str:
    if row is None or row["length_mm"] is None:
        return DASH
    varies = row["sd_over_frames_mm"]
    return _with_error(row["length_mm"], row["sd_mm"]) + (
        "" if varies is None else say(" (varies {varies})", varies=number(varies))
    )


def _bone_notes(by_bone: dict[str, dict[str, Row]]) -> tuple[str, ...]:
    """What “varies” means where it is shown, and every message once, with the bones and models it is of."""
    places: dict[str, list[str]] = {}
    varies = False
    for bone, by_model in by_bone.items():
        for model, row in by_model.items():
            varies = varies or row["sd_over_frames_mm"] is not None
            if row["message"]:
                places.setdefault(row["message"].rstrip("."), []).append(f"{bone} ({model})")
    notes = [f"{', '.join(where)}: {told(message)}." for message, where in places.items()]
    if varies:
        notes.append(
            say(
                "“varies”: standard deviation over the frames of a metacarpal's length, from its base to "
                "the MCP joint. A true skeleton keeps it near 0."
            )
        )
    return tuple(notes)
