"""Verdicts on joints and bones, by the same rule for every model, joint and layout.

The stated error decides. A centre is believed if its sd_mm (1 sigma in 3-D) is at most `wanted_mm`, the error
that the study allows, and nothing contradicts it; up to CARE_TIMES as much means "care". The 95 % radius is
1.61 (isotropic) to 1.96 (along a line) times sd_mm, so a believed centre on a finger is within 3.2 to 3.9 mm.
A doubt consists of a kind and numbers; some kinds allow no better verdict than "care" or "no", others are
only reported.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.study.stated_error import halves_mm2, radius_95_mm

if TYPE_CHECKING:
    from shukotsu.tables.rows import BoneLengthsRow, JointCentresRow

BELIEVE, CARE, NO = "believe", "care", "no"
VERDICTS = (BELIEVE, CARE, NO)
"""All verdicts, best first."""

CARE_TIMES = 3.0
"""Largest useful stated error as a multiple of wanted_mm: 95 % within 10 mm on a finger."""

WIDE_GAP_TIMES, CONTRARY_GAP_TIMES = 2.5, 5.0
"""Gaps between a joint's centre as seen from its two receivers, rms, as multiples of wanted_mm: one that the
stated error does not explain, and one that skin motion cannot cause. On a hand a gap is about 1 mm and hardly
ever 4 mm."""

LITTLE_RANGE_DEG = 10.0
"""Range of motion below which a solved centre may reflect skin motion. Skin alone rotates receivers by some
4 deg relative to each other, correlated with the motion of neighbouring joints (docs/method.md)."""

LARGE_AXIS_SD_DEG = 5.0

LEAST_KNUCKLES_MM = 9.0
"""Smallest plausible distance between neighbouring MCP centres: metacarpal heads are 12 to 14 mm wide."""

ONE_DIRECTION = 0.8
"""A centre is called uncertain in one direction if more than this share of its variance is along one line."""

Values = Mapping[str, Any]
Doubts = Mapping[str, Values]
"""Values of each doubt by its kind."""

NOT_WORN = "not-worn"
NOT_SOLVED = "not-solved"
SUSPECT = "suspect-recording"
NO_LENGTH = "no-length"
FAR = "far-from-expected"
TOO_CLOSE = "knuckles-too-close"
HALVES = "halves-disagree"
UNCERTAIN = "uncertain"
ONE_WAY = "uncertain-in-one-direction"
END_IN_DOUBT = "end-in-doubt"
BY_ANATOMY = "placed-by-anatomy"
MOVED_LITTLE = "moved-too-little"
NO_POSE = "no-valid-pose"
ONE_RECEIVER = "one-receiver"
UNSETTLED = "not-converged"
ACROSS = "across-a-moving-bone"
AXIS_IN_PLANE = "axis-near-plane"
BY_HAND = "moved-by-hand"
FROM_DOUBTFUL = "from-doubtful-joints"
NOT_THE_BONE = "not-the-bone"
NO_ERROR = "no-error-stated"
AXIS = "axis-uncertain"

LIMITS: Mapping[str, str] = {
    **dict.fromkeys((NOT_WORN, NOT_SOLVED, SUSPECT, NO_LENGTH, FAR), NO),
    **dict.fromkeys((END_IN_DOUBT, TOO_CLOSE, HALVES, NO_POSE, ONE_RECEIVER, MOVED_LITTLE, BY_ANATOMY), CARE),
    **dict.fromkeys((ACROSS, AXIS_IN_PLANE, UNSETTLED, ONE_WAY, UNCERTAIN, BY_HAND, FROM_DOUBTFUL), CARE),
    **dict.fromkeys((NOT_THE_BONE, NO_ERROR), CARE),
    AXIS: BELIEVE,
}
"""The best verdict that each kind of doubt allows; `_judge` makes some of them stricter. The order determines
which doubt is stated as the reason: possible causes of a large error come before the error itself.
"""

UNJUDGED: Any = {"verdict": "", "reason": "", "reason_values": ""}
"""Columns of a row that has no verdict, such as one of the truth or one that is judged by a later stage."""


def note_doubts(doubts: Doubts) -> Any:
    """Return the verdict columns of a row that a later stage judges, with the doubts known so far."""
    return {**UNJUDGED, "reason_values": _text(doubts)}


def doubts_of(row: Mapping[str, Any]) -> dict[str, Values]:
    """Return the doubts in a row's `reason_values` by kind; those of a judged row are in LIMITS' order."""
    text = row["reason_values"]
    return dict(json.loads(text)) if text else {}


def judged_joint(row: JointCentresRow, wanted_mm: float, doubts: Doubts | None = None) -> JointCentresRow:
    """Return a row of joint_centres with its verdict, reason, reason_values and status.

    wanted_mm : largest 1-sigma error in 3-D that is believed. doubts : doubts beyond those that follow from
    the row's numbers or that an earlier stage noted in it.
    """
    noted_before = {kind: values for kind, values in doubts_of(row).items() if kind not in _BY_NUMBERS}
    failed = row["status"] == "failed"
    of_row: Doubts = {NOT_SOLVED: {}} if failed else {**_by_numbers(row, wanted_mm), **noted_before}
    judged: JointCentresRow = _judge(row, {**of_row, **(doubts or {})}, wanted_mm)
    return judged


def judged_bone(
    bone: BoneLengthsRow, joints: Mapping[str, JointCentresRow], wanted_mm: float, *, is_whole: bool
) -> BoneLengthsRow:
    """Return a row of bone_lengths with its verdict: the worst of its end joints' and of its stated error's.

    joints : judged rows of joint_centres by joint. wanted_mm : largest 1-sigma error that is believed.
    is_whole : whether the length is that of the bone itself, not of one that starts at the wrist or ends at a
    receiver.
    """
    judged: BoneLengthsRow
    if bone["length_mm"] is None or not np.isfinite(bone["length_mm"]):
        judged = _judge(bone, {NO_LENGTH: {}}, wanted_mm)
        return judged
    ends = {end: joints[end]["verdict"] for end in (bone["starts_at"], bone["ends_at"]) if end in joints}
    worst = max(ends.values(), key=VERDICTS.index, default=BELIEVE)
    doubts: dict[str, Values] = {}
    if worst != BELIEVE:
        doubts[END_IN_DOUBT] = {
            "joints": [end for end, verdict in ends.items() if verdict == worst],
            "verdict": worst,
        }
    if not is_whole:
        doubts[NOT_THE_BONE] = {}
    judged = _judge(bone, doubts | _error(bone["sd_mm"], None, wanted_mm), wanted_mm)
    return judged


def _judge(row: Mapping[str, Any], doubts: Doubts, wanted_mm: float) -> Any:
    """Return a row of joint_centres or bone_lengths with the best verdict that all doubts allow.

    Its reason and status are set accordingly.
    """
    verdict = BELIEVE
    for kind, values in doubts.items():
        limit = LIMITS[kind]
        if kind == END_IN_DOUBT:
            limit = str(values["verdict"])
        elif kind in (UNCERTAIN, ONE_WAY):
            limit = NO if values["sd_mm"] > CARE_TIMES * wanted_mm else CARE
        elif kind == HALVES:
            limit = NO if values["gap_mm"] > CONTRARY_GAP_TIMES * wanted_mm else CARE
        verdict = max(verdict, limit, key=VERDICTS.index)
    ordered = sorted(doubts, key=list(LIMITS).index)
    columns = {
        "verdict": verdict,
        "reason": "" if verdict == BELIEVE else ordered[0],
        "reason_values": _text({kind: doubts[kind] for kind in ordered}),
    }
    if row.get("status", "failed") != "failed":
        columns["status"] = "weak" if verdict == NO else "ok"
    return {**row, **columns}


_BY_NUMBERS = frozenset({UNCERTAIN, ONE_WAY, NO_ERROR, HALVES, MOVED_LITTLE, AXIS, NOT_SOLVED})


def _by_numbers(row: Mapping[str, Any], wanted_mm: float) -> dict[str, Values]:
    """Return the doubts about a joint's centre that follow from the numbers in its row alone."""
    doubts = _error(row.get("sd_mm"), row.get("covariance_mm2"), wanted_mm)
    names = ("gap_rms_mm", "range_deg", "axis_sd_deg")
    gap_mm, range_deg, axis_sd_deg = (_number(row.get(name)) for name in names)
    if gap_mm is not None and gap_mm > WIDE_GAP_TIMES * wanted_mm:
        doubts[HALVES] = {"gap_mm": gap_mm}
    if range_deg is not None and range_deg < LITTLE_RANGE_DEG:
        doubts[MOVED_LITTLE] = {"range_deg": range_deg}
    if axis_sd_deg is not None and axis_sd_deg > LARGE_AXIS_SD_DEG and row.get("dof") == 1:
        doubts[AXIS] = {"axis_sd_deg": axis_sd_deg}
    return doubts


def _error(sd_mm: Any, covariance_mm2: Any, wanted_mm: float) -> dict[str, Values]:
    """Return the doubt about the stated error, if any; covariance_mm2 : as for `halves_mm2`."""
    sd = _number(sd_mm)
    if sd is None:
        return {NO_ERROR: {}}
    if sd <= wanted_mm:
        return {}
    halves = [half for half in halves_mm2(covariance_mm2, sd) if np.isfinite(half).all()]
    half = max(halves or halves_mm2(None, sd), key=np.trace)  # the less certain one
    values = {"sd_mm": sd, "radius_95_mm": radius_95_mm(half), "wanted_mm": wanted_mm}
    worst_mm = float(np.sqrt(max(np.linalg.eigvalsh(each)[-1] for each in halves or [half])))
    if worst_mm**2 > ONE_DIRECTION * sd**2:
        return {ONE_WAY: {**values, "worst_mm": worst_mm}}
    return {UNCERTAIN: values}


def _number(value: Any) -> float | None:
    """Return a cell's value as a float, or None if it is empty or not a finite number."""
    return float(value) if isinstance(value, (int, float, np.floating)) and np.isfinite(value) else None


def _text(doubts: Doubts) -> str:
    """Return doubts as JSON, numbers rounded to 0.001 so that the same input gives the same bytes."""
    rounded = {
        kind: {name: round(v, 3) if isinstance(v, float) else v for name, v in values.items()}
        for kind, values in doubts.items()
    }
    return json.dumps(rounded, ensure_ascii=False) if rounded else ""
