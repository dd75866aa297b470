"""The study's page: a hand in motion, three numbers and figures, then all details."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from itertools import groupby, pairwise
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import Markup

from shukotsu.errors import InputError
from shukotsu.report import judged_models, provenance, recording_results, skeleton_tables
from shukotsu.report.belief import joint_anchor, reasons_of
from shukotsu.report.figures import study_figures
from shukotsu.report.figures.drawing import page_picture, page_pictures, taken_failures
from shukotsu.report.methods_text import REFERENCES, methods_text
from shukotsu.report.movement_results import compared_factors, read_movement, subject_groups
from shukotsu.report.recording_page import recording_links
from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import Link, format_value, link
from shukotsu.report.templates import render
from shukotsu.report.viewer import View, view_of
from shukotsu.resources import VERSION
from shukotsu.scores.paired_statistics import FEWEST_SUBJECTS
from shukotsu.study.results import (
    FIGURE_KINDS,
    MODEL_COMPARISONS,
    MOVEMENT_COMPARISONS,
    STUDY_FIGURES,
    STUDY_TABLES,
)
from shukotsu.study.study import Study
from shukotsu.study.verdict import BELIEVE, CARE, NO, VERDICTS
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.translation import tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow

FEW_HANDS = 30
"""Largest number of rows of bone lengths that are shown unfolded."""
MOST_TRIED = 8
"""Largest number of recordings that are tried to find one whose hand can be shown in motion."""
PACKAGES = ("numpy", "pyarrow", "scipy", "snakemake")


class SubjectCard(NamedTuple):
    """A subject: a link to its page, small pictures of its hands, believed joints, links to recordings."""

    to: Link
    hands: list[Markup]
    believed: str
    suspect: bool
    recordings: list[Link]


def render_study(results: StudyResults, study: Study) -> str:
    """Return the study's page as HTML; the same results give the same text.

    Raises InputError if a file is not the expected table.
    """
    panels, movement = study_figures.model_panels(results), read_movement(results)
    factors, levels = compared_factors(results, study, movement), subject_groups(study)
    replay = panels.pop(judged_models.REPLAY, None)
    with_lengths = [hand for hand in results.hands if results.bones_of.get((hand, results.leading))]
    ends = [f"{end:g}" for end in CLASSES_MM]
    packages = (f"{package} {metadata.version(package)}" for package in PACKAGES)
    parts: dict[str, Any] = {
        "view": _front(results),
        "schema": small_hand(results, with_lengths[0], results.leading) if with_lengths else None,
        "models": page_pictures(panels.values()),
        "groups": page_pictures(study_figures.group_panels(factors, len(results.subjects))),
        "replay": [("", page_picture(replay))] if replay else [],
        "ranges": {
            task: [("", page_picture(panel)) for panel in of_task]
            for task, of_task in study_figures.range_panels(movement).items()
        },
        "curves": {
            event: page_pictures(of_event)
            for event, of_event in study_figures.study_panels(movement, levels).items()
        },
        "curve_looks": [*study_figures.group_looks(dict.fromkeys(levels.values())).values()],
        "no_curves": tr(study_figures.NO_CYCLES),
    }
    for message in taken_failures():  # after every picture, before the list of problems
        results.add_problem(message)
    return render(
        "study.html.j2",
        tables_at="",
        study=results.name,
        used=judged_models.used_text(results),
        numbers=judged_models.big_numbers(results),
        take=judged_models.model_to_take(results),
        doubted=judged_models.care_line(results),
        next=judged_models.next_step(results),
        model=results.leading,
        fewest=FEWEST_SUBJECTS,
        joints=joint_picture(results),
        classes=[f"< {ends[0]}", *(f"{low}–{high}" for low, high in pairwise(ends)), f"> {ends[-1]}"],
        problems=provenance.all_problems(results),
        accepted=provenance.faults_listed(results.accepted),
        factors=factors,
        subjects=[_card(results, who) for who in results.sessions],
        lengths=skeleton_tables.lengths_table(results, results.leading),
        lengths_open=len(results.hands) <= FEW_HANDS,
        methods=methods_text(results, movement),
        references=REFERENCES,
        files=study_files(results),
        exports=exported_files(results) if study.exports else {},
        versions=", ".join([f"shukotsu {VERSION}", f"python {platform.python_version()}", *packages]),
        **parts,
    )


def _front(results: StudyResults) -> View | None:
    """Return the hand in motion from the first usable recording that can be shown, or None."""
    counted = [recording for recording in results.shown if recording.hand not in results.suspect]
    used = [recording for recording in counted if results.status_of(recording)[0] == "used"]
    for recording in sorted(used, key=lambda each: each.role == "calibration")[:MOST_TRIED]:
        try:
            motion = recording_results.read_stretch(results, recording, results.leading)
        except InputError:
            continue
        return view_of(f"{recording.hand}, {recording.task}, {results.leading}", motion)
    return None


def _card(results: StudyResults, who: SubjectSession) -> SubjectCard:
    page, model, hands = results.paths.report, results.leading, results.hands_of(*who)[::-1]
    rows = [row for hand in hands for row in results.joints_of.get((hand, model), [])]
    return SubjectCard(
        link(who.label, page, results.paths.subject_page(*who)),
        [small_hand(results, hand, model) for hand in hands],
        believed_text(rows),
        any(hand in results.suspect for hand in hands),
        recording_links(results, page, who),
    )


def study_files(results: StudyResults) -> list[tuple[str, list[Link]]]:
    """Return links to the files that accompany the page: figures for print, tables, configuration."""
    paths = results.paths
    page, tables = paths.report, (*STUDY_TABLES, *MODEL_COMPARISONS, *MOVEMENT_COMPARISONS)
    figures = [
        (name, [link(kind, page, paths.figures / f"{name}.{kind}") for kind in FIGURE_KINDS])
        for name in STUDY_FIGURES
    ]
    return [
        *figures,
        ("tables", [link(name, page, paths.study_table(name)) for name in tables]),
        ("configuration", [link(paths.resolved.name, page, paths.resolved)]),
    ]


def exported_files(results: StudyResults) -> dict[str, list[Link]]:
    """Return links to the files in the folder of exports, grouped by ending."""
    exported: dict[str, list[Link]] = {}
    for file in sorted(results.paths.exports.glob("[!.]*")):  # hidden files are Snakemake's
        if not file.name.endswith(".failed.txt"):
            kind = "/" if file.is_dir() else file.suffix.removeprefix(".")
            exported.setdefault(kind, []).append(link(file.name, results.paths.report, file))
    return exported


def render_failure(message: str) -> str:
    """Return a page that only states why there is no report."""
    return render("base.html.j2", title=tr("No report"), message=translated(message))


CLASSES_MM = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Upper limits of the classes of errors that have different colours; the last class has none."""
MARKS = {BELIEVE: "", CARE: "◆", NO: "✕"}
_MEDIANS_OVER = 3
"""With more hands than this, the first row shows their medians."""
_FAN_DEG = {"thumb": 48.0, "index": 12.0, "middle": 2.0, "ring": -8.0, "little": -19.0}
"""Direction of each digit of a right hand from the wrist, relative to straight on, positive to the thumb."""
_WRIST_MM, _USUAL_MM = 30.0, 25.0
"""Distance drawn from the wrist to the start of a first bone, and length drawn for a bone, if unknown."""


@dataclass(frozen=True)
class JointCell:
    """A cell for a joint of a hand.

    level : class of its error, -1 if none is stated. why : text of its tooltip. href : link to its row on the
    subject's page.
    """

    sd: str
    level: int
    mark: str
    why: str = ""
    href: str = ""


class JointRow(NamedTuple):
    """A hand's joints in the order of columns, None if the model lacks one, and the number believed."""

    who: Link
    hand: str
    cells: list[JointCell | None]
    believed: str


class JointPicture(NamedTuple):
    """The picture of all joints: digits with their numbers of columns, names of joints, and rows of hands."""

    digits: list[tuple[str, int]]
    joints: list[str]
    rows: list[JointRow]
    medians: list[JointCell | None]


def joint_picture(results: StudyResults) -> JointPicture | None:
    """Return the picture of all joints under the leading model, or None if no hand has a joint."""
    model, page = results.leading, results.paths.report
    of_hand = {
        hand: {row["joint"]: row for row in results.joints_of.get((hand, model), [])}
        for hand in results.hands
    }
    joints = study_figures.joints_in_order(results, {joint for rows in of_hand.values() for joint in rows})
    if not joints:
        return None
    rows = []
    for hand, row_of in of_hand.items():
        to = link(hand.who.label, page, results.paths.subject_page(*hand.who))
        cells = [
            _cell([row_of[joint]], f"{to.href}#{joint_anchor(hand, joint)}") if joint in row_of else None
            for joint in joints
        ]
        rows.append(JointRow(to, word(hand.hand), cells, believed_text([*row_of.values()])))
    parts = [joint.rpartition("_") for joint in joints]
    digits = [(word(digit), len(list(group))) for digit, group in groupby(digit for digit, _, _ in parts)]
    names = [part.upper() if digit else word(part) for digit, _, part in parts]
    judged = [rows for hand, rows in of_hand.items() if hand not in results.suspect and rows]
    medians = [_cell([rows[joint] for rows in judged if joint in rows]) for joint in joints]
    return JointPicture(digits, names, rows, medians if len(judged) > _MEDIANS_OVER else [])


def believed_text(rows: Sequence[JointCentresRow]) -> str:
    """Return the number of believed joints over the number of all, as text."""
    return f"{sum(row['verdict'] == BELIEVE for row in rows)}/{len(rows)}"


def _cell(rows: Sequence[JointCentresRow], href: str = "") -> JointCell | None:
    """Return the cell of a joint; for several hands, with their median error and median verdict."""
    if not rows:
        return None
    sds = [row["sd_mm"] for row in rows if row["sd_mm"] is not None]
    sd = median(sds) if sds else None
    verdict = sorted((row["verdict"] for row in rows), key=list(MARKS).index)[len(rows) // 2]
    level = -1 if sd is None else sum(sd >= end for end in CLASSES_MM)
    why = "; ".join(reasons_of(rows[0])) if verdict != BELIEVE and len(rows) == 1 else ""
    return JointCell(format_value("sd_mm", sd), level, MARKS[verdict], why, href)


def small_hand(results: StudyResults, hand: Hand, model: str) -> Markup:
    """Return an SVG diagram of the back of the hand; only its lengths and verdicts are measured."""
    lengths = {(row["digit"], row["bone"]): row for row in results.bones_of.get((hand, model), [])}
    verdicts = {row["joint"]: row["verdict"] for row in results.joints_of.get((hand, model), [])}
    layout = results.layouts[hand]
    wrist = layout.wrist.joint if layout.wrist else None
    position: dict[str, tuple[float, float]] = {wrist: (0.0, 0.0)} if wrist else {}
    lines = []
    side = 1.0 if hand.hand == "right" else -1.0
    for index, (name, digit) in enumerate(layout.digits.items()):
        angle = math.radians(_FAN_DEG.get(name, 10.0 * index))
        right, up = -side * math.sin(angle), -math.cos(angle)
        bones = [lengths.get((name, bone), {}) for bone in digit.segments]
        starts = bones[0].get("starts_at", "") if layout.is_hand else wrist
        reach, line = 0.0 if starts == wrist else _WRIST_MM, [(0.0, 0.0)]
        for joint, bone in zip(digit.joints, bones, strict=True):
            line.append((right * reach, up * reach))
            position.setdefault(joint, line[-1])
            reach += bone.get("length_mm") or _USUAL_MM
        lines.append([*line, (right * reach, up * reach)])
    paths = [("bones", "".join("M" + "L".join(map(_point, line)) for line in lines))]
    for verdict in VERDICTS:
        dots = [point for joint, point in position.items() if verdicts.get(joint) == verdict]
        if dots:
            paths.append((verdict, "".join(f"M{_point(point)}h0" for point in dots)))
    title = tr("{hand} hand of {who}, joints by verdict", hand=word(hand.hand), who=hand.who.label)
    inside = Markup("").join(Markup('<path class="{}" d="{}"/>').format(*path) for path in paths)
    across, down = zip(*(point for line in lines for point in line), strict=True)
    box = (min(across) - 8, min(down) - 8, max(across) - min(across) + 16, max(down) - min(down) + 16)
    size = " ".join(f"{length:.0f}" for length in box)
    return Markup('<svg viewBox="{}" role="img"><title>{}</title>{}</svg>').format(size, title, inside)


def _point(point: tuple[float, float]) -> str:
    return f"{point[0]:.0f} {point[1]:.0f}"
