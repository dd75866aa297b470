"""Tables of the skeleton itself: how far each joint can be trusted, and how long each bone is."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from schemas.study import Hand
from stages.report.data_table import DASH, Block, DataTable, counted, number
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


@dataclass(frozen=True)
class Folded:
    """A table that is folded away under a summary line."""

    summary: str
    table: DataTable


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
    error = "" if row["sd_mm"] is None else f" ± {number(row['sd_mm'])}"
    varies = row["sd_over_frames_mm"]
    return number(row["length_mm"]) + error + ("" if varies is None else f" (varies {number(varies)})")


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
