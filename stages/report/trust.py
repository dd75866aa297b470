"""Which joints of a hand to believe, and why not."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable

from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import N_, tr
from shukotsu.stages.report.belief import BELIEFS, belief, commonest, reasons_of
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import Column, DataTable, quantity_column, table_of, text_column

NO_JOINT = N_("No joint was solved; the reason is among the problems.")
_NUMBERS = ("sd_mm", "range_deg", "gap_rms_mm", "gap_rms_free_mm", "axis_plane_deg", "correction_mm")


def joint_table(results: StudyResults, hand: Hand, model: str) -> DataTable:
    """Every joint of a hand under a model: verdict, the numbers that any joint has, the reasons for doubt."""
    rows = results.joints_of.get((hand, model), [])
    columns = (
        text_column(tr("Joint"), "joint"),
        Column(tr("Believe it?"), lambda row: tr(belief(row)), is_text=True),
        *(quantity_column(name) for name in _NUMBERS if any(row[name] is not None for row in rows)),
        Column(tr("Why"), lambda row: "; ".join(reasons_of(row)), is_text=True),
    )
    caption = tr("Whether to believe the joints of {model}: {hand}.", model=model, hand=hand)
    return table_of(caption, columns, rows, tr(NO_JOINT))


def study_beliefs(results: StudyResults, model: str) -> dict[str, str]:
    """Return each joint's verdict in the middle one of the study's hands: one of BELIEFS by joint."""
    of_joint: dict[str, list[str]] = defaultdict(list)
    for hand in results.hands:
        for row in results.joints_of.get((hand, model), []):
            of_joint[row["joint"]].append(belief(row))
    return {joint: commonest(found) for joint, found in of_joint.items()}


def believed_counts(rows: Iterable[Row]) -> str:
    """Count joints of rows of joint_centres to believe, with care and not: for a line of summary."""
    counts = Counter(belief(row) for row in rows)
    words = dict(zip(BELIEFS, (tr("to believe"), tr("with care"), tr("not")), strict=True))
    return tr(", ").join(
        tr("{count} {belief}", count=counts[each], belief=words[each]) for each in BELIEFS if counts[each]
    ) or tr("no joint was solved")
