"""Which joints to believe: hand by hand, and over the whole study; and the reasons."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from shukotsu.schemas.study import Hand, path_token
from shukotsu.sentences.translation import N_, listed, tr, word
from shukotsu.stages.report.belief import BELIEFS, belief, commonest, reasons_of
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import DASH, Block, DataTable, number

APART_MM = 5.0
"""Models that put a joint farther apart than this cannot both be right: it is half a bone's breadth."""

NO_JOINT = N_("No joint was solved; the reason is under “What went wrong”.")

_COLUMNS = (
    (N_("Moved [deg]"), "range_deg", 1),
    (N_("Gap rms [mm]"), "gap_rms_mm", 2),
    (N_("Free gap rms [mm]"), "gap_rms_free_mm", 2),
    (N_("Axis to plane [deg]"), "axis_plane_deg", 1),
    (N_("Correction [mm]"), "correction_mm", 1),
)
"""What else is told of a joint where any joint of the hand has it: heading, column, decimals."""


@dataclass(frozen=True)
class Verdict:
    """One joint of one hand under one model: one of BELIEFS, and why.

    row : of joint_centres. apart_mm : how far from it the farthest other model puts the joint, and
    apart_model which; None where no other model has it.
    """

    row: Row
    apart_mm: float | None
    apart_model: str

    @property
    def joint(self) -> str:
        """Its name."""
        return str(self.row["joint"])

    @property
    def believed(self) -> str:
        """One of BELIEFS."""
        return belief(self.row)

    @property
    def doubts(self) -> list[str]:
        """Reasons for doubt and remarks, what decides first; may be empty."""
        return reasons_of(self.row)

    @property
    def why(self) -> str:
        """The same in one line."""
        return "; ".join(self.doubts)


def verdicts(results: StudyResults, hand: Hand, model: str) -> list[Verdict]:
    """Judge every joint of a hand under one model."""
    others = {
        name: {row["joint"]: row for row in results.joints_of.get((hand, name), [])}
        for name in results.models
        if name != model
    }
    found = []
    for row in results.joints_of.get((hand, model), []):
        apart = {
            name: distance
            for name, rows in others.items()
            if (distance := _apart_mm(row, rows.get(row["joint"]))) is not None
        }
        farthest = max(apart, key=lambda name: apart[name], default="")
        found.append(Verdict(row, apart.get(farthest), farthest))
    return found


def joint_table(results: StudyResults, hand: Hand, model: str) -> DataTable:
    """Every joint of a hand with its numbers; the reasons below, one for all joints that share it.

    Rows have identifiers that a picture of the hand links to, see `joint_anchor`.
    """
    found = verdicts(results, hand, model)
    columns = [c for c in _COLUMNS if any(v.row[c[1]] is not None for v in found)]
    header = (
        tr("Joint"),
        tr("Believe it?"),
        tr("SD of the centre [mm]"),
        *(heading for heading, _, _ in columns),
        tr("Farthest other model [mm]"),
    )
    rows = tuple(
        (
            v.joint,
            tr(v.believed),
            number(v.row["sd_mm"]),
            *(number(v.row[name], decimals) for _, name, decimals in columns),
            _apart_in_words(v),
        )
        for v in found
    )
    return DataTable(
        tr("Whether to believe the joints of {model}: {hand}.", model=model, hand=hand),
        (Block(header, rows),),
        tuple(reasons(found)) if rows else (tr(NO_JOINT),),
        frozenset({0, 1, len(header) - 1}),
        tuple(joint_anchor(hand, v.joint, model) for v in found),
    )


def joint_anchor(hand: Hand, joint: str, model: str = "") -> str:
    """The identifier of a joint's row on the page of its subject; of the study's page without a model."""
    return "-".join(path_token(part) for part in ("joint", model, hand.hand, joint) if part)


def reasons(found: Iterable[Verdict]) -> list[str]:
    """Sentences: why joints are doubted, each reason once, with the joints that it is of."""
    found = list(found)
    of_reason: dict[str, list[str]] = defaultdict(list)
    for verdict in found:
        if verdict.why:
            of_reason[verdict.why].append(verdict.joint)
    return [f"{_named(joints, found)}: {why}." for why, joints in of_reason.items()]


def _named(joints: list[str], found: list[Verdict]) -> str:
    return tr("All joints") if len(joints) == len(found) > 1 else listed(map(word, joints))


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


def _apart_mm(row: Row, other: Row | None) -> float | None:
    """Distance between two models' places of a joint in the frame of a receiver that both name."""
    if other is None or "failed" in (row["status"], other["status"]):
        return None
    for side in ("child", "parent"):
        if row[f"{side}_segment"] and row[f"{side}_segment"] == other[f"{side}_segment"]:
            places = [[each[f"{side}_{axis}_mm"] for axis in "xyz"] for each in (row, other)]
            if None in places[0] or None in places[1]:
                continue
            return math.dist(places[0], places[1])
    return None


def _apart_in_words(verdict: Verdict) -> str:
    if verdict.apart_mm is None:
        return DASH
    sign = "◆ " if verdict.apart_mm > APART_MM else ""
    return f"{sign}{number(verdict.apart_mm, 1)}, {verdict.apart_model}"
