"""Tables of the skeleton itself: how far each joint can be trusted, and how long each bone is."""

from __future__ import annotations

from collections import Counter

from schemas.study import Hand
from stages.report.data_table import DASH, Block, DataTable, Folded, counted, number
from stages.report.study_results import Row, StudyResults

STATUS_MARKS = {"ok": "ok", "weak": "◆ weak", "failed": "✕ failed"}

_JOINT_HEADER = (
    "Joint",
    "Status",
    "Range of motion [deg]",
    "Gap rms [mm]",
    "Free gap rms [mm]",
    "SD of the centre [mm]",
    "Axis to plane [deg]",
    "Correction [mm]",
    "Message",
)

_RECEIVER_HEADER = (
    "Receiver",
    "Status",
    "Along the bone [mm]",
    "To the thumb's side [mm]",
    "Over the bone [mm]",
    "Residual [mm]",
    "Residual [deg]",
    "Came loose",
    "Message",
)


def joint_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """One table of joints for each model of a hand, in mm and degrees, its doubtful joints counted."""
    folded = []
    for model in results.models:
        rows = results.joints_of.get((hand, model), [])
        table = DataTable(
            f"Joints of subject {hand.subject}, {hand.hand} hand, model {model}.",
            (Block(_JOINT_HEADER, tuple(_joint_cells(row) for row in rows)),),
            () if rows else ("No joint was solved; the reason is under “What went wrong”.",),
            frozenset({0, 1, 8}),
        )
        folded.append(Folded(f"{hand.hand.capitalize()} hand, {model}: {_counts(rows)}", table))
    return folded


def bone_table(results: StudyResults, hand: Hand) -> DataTable:
    """The bone lengths of a hand, mm, one column a model; a bone is named after its segment."""
    by_bone: dict[str, dict[str, Row]] = {}
    uses = Counter(segment for digit in results.layouts[hand].digits.values() for segment in digit.segments)
    for model in results.models:
        for row in results.bones_of.get((hand, model), []):
            name = row["bone"] if uses[row["bone"]] < 2 else f"{row['bone']} ({row['digit']})"
            by_bone.setdefault(name, {})[model] = row
    order = {segment: index for index, segment in enumerate(results.layouts[hand].segments)}
    bones = sorted(by_bone, key=lambda name: order.get(name.split(" ")[0], len(order)))
    rows = tuple((bone, *(_length(by_bone[bone].get(model)) for model in results.models)) for bone in bones)
    return DataTable(
        f"Bone lengths of subject {hand.subject}, {hand.hand} hand, in mm, with 1-sigma error.",
        (Block(("Bone [mm]", *results.models), rows),),
        _bone_notes(by_bone) if rows else ("No bone length was computed.",),
    )


def receiver_tables(results: StudyResults, hand: Hand) -> list[Folded]:
    """Where the receivers of a hand sit on their bones: one table for each model that fits the whole hand."""
    folded = []
    for model in results.fitted:
        rows = results.receivers_of.get((hand, model), [])
        table = DataTable(
            f"Receivers of subject {hand.subject}, {hand.hand} hand, model {model}, with 1-sigma errors.",
            (Block(_RECEIVER_HEADER, tuple(_receiver_cells(row) for row in rows)),),
            () if rows else ("No hand was fitted; the reason is under “What went wrong”.",),
            frozenset({0, 1, 7, 8}),
        )
        folded.append(Folded(f"{hand.hand.capitalize()} hand, {model}: {_receiver_counts(rows)}", table))
    return folded


def _receiver_cells(row: Row) -> tuple[str, ...]:
    return (
        row["segment"],
        STATUS_MARKS.get(str(row["status"]), str(row["status"])),
        *(_with_error(row[f"{name}_mm"], row[f"{name}_sd_mm"]) for name in ("along", "lateral", "height")),
        number(row["residual_mm"]),
        number(row["residual_deg"]),
        _loose(row),
        row["message"],
    )


def _loose(row: Row) -> str:
    if row["loose_from_frame"] is None:
        return ""
    where = f" of {row['loose_task']}" if row["loose_task"] else ""
    return (
        f"◆ from frame {row['loose_from_frame']}{where}: moved {number(row['loose_shift_mm'], 1)} mm, "
        f"turned {number(row['loose_turn_deg'], 1)} deg"
    )


def _receiver_counts(rows: list[Row]) -> str:
    if not rows:
        return "no hand was fitted"
    loose = sum(row["loose_from_frame"] is not None for row in rows)
    doubts = Counter(row["status"] for row in rows)
    told = [f"{doubts[word]} {word}" for word in ("weak", "failed") if doubts[word]]
    told += [f"{loose} came loose"] if loose else []
    return ", ".join([counted(len(rows), "receiver"), *(told or ["all ok"])])


def _with_error(value: float | None, sd: float | None) -> str:
    return number(value) + (f" ± {number(sd)}" if value is not None and sd is not None else "")


def _joint_cells(row: Row) -> tuple[str, ...]:
    return (
        row["joint"],
        STATUS_MARKS.get(str(row["status"]), str(row["status"])),
        number(row["range_deg"], 1),
        number(row["gap_rms_mm"]),
        number(row["gap_rms_free_mm"]),
        number(row["sd_mm"]),
        number(row["axis_plane_deg"], 1),
        number(row["correction_mm"], 1),
        row["message"],
    )


def _counts(rows: list[Row]) -> str:
    if not rows:
        return "no joint was solved"
    statuses = Counter(row["status"] for row in rows)
    doubts = [f"{statuses[word]} {word}" for word in ("weak", "failed") if statuses[word]]
    return ", ".join([counted(len(rows), "joint"), *(doubts or ["all ok"])])


def _length(row: Row | None) -> str:
    if row is None or row["length_mm"] is None:
        return DASH
    varies = row["sd_over_frames_mm"]
    return _with_error(row["length_mm"], row["sd_mm"]) + (
        "" if varies is None else f" (varies {number(varies)})"
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
    notes = [f"{', '.join(where)}: {message}." for message, where in places.items()]
    if varies:
        notes.append(
            "“varies”: standard deviation over the frames of a metacarpal's length, from its base to the "
            "MCP joint. A true skeleton keeps it near 0."
        )
    return tuple(notes)
