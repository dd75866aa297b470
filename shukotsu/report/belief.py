"""Verdicts on joints and bones in signs and words, and what would improve the joints."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from shukotsu.report import table_cells
from shukotsu.report.palette import AMBER, INK, NO, WEAK_LINE, PlotMark
from shukotsu.report.study_results import StudyResults
from shukotsu.report.table_cells import DataTable, PageColumn, number
from shukotsu.study import findings, verdict
from shukotsu.study.layout import Layout
from shukotsu.tables.subjects import Hand
from shukotsu.translation import N_, tr, translated, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import GainsRow, JointCentresRow

BELIEVED, CARE, NOT, UNWORN = N_("✓ yes"), N_("◆ with care"), N_("✕ no"), N_("– not worn")
BELIEFS = (BELIEVED, CARE, NOT, UNWORN)
"""All verdicts as displayed, best first.

Pictures mark them by shape and colour (BELIEF_MARKS) and omit joints for which no receiver was worn.
"""

BELIEF_MARKS: Mapping[str, PlotMark] = {
    BELIEVED: PlotMark("o", INK, INK),
    CARE: PlotMark("D", AMBER, WEAK_LINE),
    NOT: PlotMark("X", NO, NO),
}

NO_JOINT = N_("no joint was solved")

_SHOWN = {verdict.BELIEVE: BELIEVED, verdict.CARE: CARE, verdict.NO: NOT}
"""Displayed verdict for each value of the column `verdict`."""

_DOUBT_TEXTS: Mapping[str, str] = {
    verdict.NOT_WORN: N_("no receiver on {segments}, so it is not measured"),
    verdict.SUSPECT: N_("findings in its recording exclude it from all statistics"),
    verdict.FAR: N_(
        "the fitted hand is implausible ({what} is {sd:.0f} SD from the average): wrong units, swapped "
        "receivers, or a receiver far from the middle of its bone"
    ),
    verdict.HALVES: N_(
        "the receivers disagree by {gap_mm:.0f} mm, more than the stated error explains: a loose receiver, "
        "a wrong quaternion order or angle convention, or thick skin"
    ),
    verdict.TOO_CLOSE: str(findings.PROBLEMS[verdict.TOO_CLOSE]),
    verdict.UNCERTAIN: N_("the error exceeds {wanted_mm:g} mm (1 sigma, 3-D)"),
    verdict.ONE_WAY: N_(
        "the error exceeds {wanted_mm:g} mm (1 sigma, 3-D), nearly all of it in one direction"
    ),
    verdict.BY_ANATOMY: N_("the position comes from anatomy rather than from the recording"),
    verdict.MOVED_LITTLE: N_("moved only {range_deg:.0f} deg; skin motion alone can cause this"),
    verdict.NO_POSE: N_("no valid pose of {segments}: estimated from anatomy and the other receivers"),
    verdict.ONE_RECEIVER: N_("no receiver on {segments}: estimated from bone lengths"),
    verdict.UNSETTLED: N_("the fit of the hand did not converge"),
    verdict.ACROSS: N_(
        "estimated from the receiver on {receiver} across {segment}, which moves but has no receiver; the "
        "data do not show the error that this causes"
    ),
    verdict.AXIS_IN_PLANE: N_(
        "the axis is {axis_plane_deg:.0f} deg from the plane that cuts it, which moved the centre "
        "{slide_mm:.0f} mm along the axis"
    ),
    verdict.BY_HAND: N_("moved {correction_mm:.1f} mm by hand; the stated error does not include this move"),
    verdict.FROM_DOUBTFUL: N_("derived from joints that are not believed: {joints}"),
    verdict.NO_ERROR: N_("no error is stated for the position"),
    verdict.AXIS: N_("the axis is uncertain by {axis_sd_deg:.0f} deg"),
}
"""Sentence about a joint for each kind of doubt."""


def belief(row: Mapping[str, object]) -> str:
    """Return the displayed verdict (one of BELIEFS) of a row of joint_centres or bone_lengths."""
    if row.get("reason") == verdict.NOT_WORN:
        return UNWORN
    return _SHOWN[str(row["verdict"])]


def reasons_of(row: Mapping[str, Any]) -> list[str]:
    """Return the doubts about a joint and its row's message as sentences, the most important first.

    The sentences do not include the joint's 1-sigma error, which has a column of its own, so that joints with
    the same reason have the same text.
    """
    doubts, message = verdict.doubts_of(row), translated(row["message"]).rstrip(".。")
    reasons = []
    for kind, values in doubts.items():
        if kind in _DOUBT_TEXTS:
            texts = {name: word(value) if isinstance(value, str) else value for name, value in values.items()}
            reasons.append(tr(_DOUBT_TEXTS[kind], **texts))
    if verdict.NOT_WORN in doubts:
        return reasons
    if verdict.NOT_SOLVED in doubts:
        message = tr("has no position: {message}", message=message)
    return [*reasons, message] if message else reasons


def wanted_text(layouts: Iterable[Layout], times: float = 1.0) -> str:
    """Return the error of a centre, mm, that layouts allow, times a factor, as text such as "2 or 10"."""
    wanted = sorted({layout.wanted_mm for layout in layouts})
    return tr(" or ").join(f"{times * each:g}" for each in wanted)


_NUMBERS = ("sd_mm", "range_deg", "gap_rms_mm", "gap_rms_free_mm", "axis_plane_deg", "correction_mm")


def joint_table(results: StudyResults, hand: Hand, model: str) -> DataTable:
    """Return a table of a hand's joints under a model: verdicts, numbers and reasons for doubt.

    Numbers that no joint has are omitted.
    """
    rows: Sequence[Mapping[str, Any]] = results.joints_of.get((hand, model), [])
    known = [name for name in _NUMBERS if any(row[name] is not None for row in rows)]
    row_name = Markup('<span id="{}">{}</span>' if model == results.leading else "{1}")  # the target of links
    columns = (
        PageColumn(
            tr("Joint"),
            lambda row: row_name.format(joint_anchor(hand, row["joint"]), word(row["joint"])),
            is_text=True,
        ),
        PageColumn(tr("Believe it?"), lambda row: tr(belief(row)), is_text=True),
        *map(table_cells.quantity_column, known),
        PageColumn(tr("Why"), lambda row: "; ".join(reasons_of(row)), is_text=True),
    )
    caption = tr("Joints of {hand}, {model}.", model=model, hand=hand)
    return table_cells.table_of(caption, columns, rows, tr(NO_JOINT), source="joint_centres")


def joint_anchor(hand: Hand, joint: str) -> str:
    """Return the anchor of a joint's row on its subject's page."""
    return f"{hand.hand}-{joint}"


def study_beliefs(results: StudyResults, model: str) -> dict[str, str]:
    """Return each joint's median verdict over the study's hands; between two verdicts, the worse one.

    Hands without a receiver for the joint are not counted.
    """
    of_joint: dict[str, list[str]] = defaultdict(list)
    for hand in results.hands:
        for row in results.joints_of.get((hand, model), []):
            if (shown := belief(row)) != UNWORN:
                of_joint[row["joint"]].append(shown)
    return {
        joint: sorted(beliefs, key=BELIEFS.index)[len(beliefs) // 2] for joint, beliefs in of_joint.items()
    }


def believed_counts(rows: Iterable[JointCentresRow]) -> str:
    """Return the number of joints with each verdict as one line of text."""
    counts = Counter(belief(row) for row in rows)
    return tr(", ").join(f"{tr(each)} {counts[each]}" for each in BELIEFS if counts[each]) or tr(NO_JOINT)


NEAR_TIMES = 1.25
"""Largest stated error, as a multiple of wanted_mm, that one more measurement or movement may remedy."""


def near_lines(rows: Iterable[JointCentresRow], gains: Sequence[GainsRow], layout: Layout) -> list[str]:
    """Return sentences on joints whose error is just above `wanted_mm`, and on what would improve them.

    rows, gains : rows of joint_centres and of gains of the same hand.
    """
    near, wanted_mm = [], layout.wanted_mm
    for row in rows:
        only = set(verdict.doubts_of(row)) <= {verdict.UNCERTAIN, verdict.ONE_WAY, verdict.AXIS}
        sd_mm = row["sd_mm"]
        if layout.is_hand and only and sd_mm is not None and wanted_mm < sd_mm <= NEAR_TIMES * wanted_mm:
            near.append(row["joint"])
    if not near:
        return []
    mended = {row["joint"]: row for row in reversed(gains) if row["joint_sd_after_mm"] <= wanted_mm}
    lines = [
        tr(
            "{joints}: the error is {wanted_mm:g} to {most_mm:g} mm (1 sigma, 3-D). This is sufficient for "
            "angles, ranges of motion and comparisons of groups, but not for moment arms, which are only "
            "about 10 mm at a finger joint.",
            joints=near,
            wanted_mm=wanted_mm,
            most_mm=NEAR_TIMES * wanted_mm,
        ),
        *gain_lines([mended[joint] for joint in near if joint in mended]),
    ]
    if others := [joint for joint in near if joint not in mended]:
        text = N_(
            "To improve {joints}, record another calibration in which they bend slowly over their full "
            "range with the palm at rest, or combine two measurements of the hand."
        )
        lines.append(tr(text, joints=others))
    return lines


MOST_GAINS = 3

_PARTS = {
    "along": N_("measuring the position of the receiver along the {bone}"),
    "lateral": N_("measuring the sideways offset of the receiver from the {bone}"),
    "height": N_("measuring the height of the receiver above the {bone}"),
    "distal": N_("measuring the distance from the receiver on the {bone} to the next joint"),
    "touch": N_("touching a known point with the {bone} fingertip"),
    "": N_("measuring the {bone} with a calliper"),
}
"""Action for each part of a quantity in the table gains; parts are named as in measurements.tsv."""


def gain_lines(rows: Sequence[GainsRow]) -> list[str]:
    """Return sentences on what to record or measure next, for the first MOST_GAINS rows of gains."""
    lines = []
    for row in rows[:MOST_GAINS]:
        segment, _, part = row["quantity"].partition(".")
        bone = word(segment).replace("_", " ")
        if bone.endswith(("proximal", "middle", "distal")) and part != "touch":
            bone += " phalanx"
        text = tr(
            "{action} to within {sd_mm:.1f} mm would reduce the error of {joint} from "
            "{joint_sd_before_mm:.1f} to {joint_sd_after_mm:.1f} mm (mean of all joints: {before} to {after} "
            "mm).",
            **{name: row[name] for name in ("joint", "sd_mm", "joint_sd_before_mm", "joint_sd_after_mm")},
            action=table_cells.capital(tr(_PARTS[part], bone=bone)),
            before=number(row["mean_sd_before_mm"]),
            after=number(row["mean_sd_after_mm"]),
        )
        lines.append(text)
    return lines
