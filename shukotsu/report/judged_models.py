"""The study's outcome for the first screen and the terminal: three numbers, a model, and the next step."""

from __future__ import annotations

import re
import textwrap
from collections import Counter, defaultdict
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from shukotsu.report import belief, provenance
from shukotsu.report.study_results import StudyResults, hand_of
from shukotsu.report.table_cells import DASH, format_value, p_text
from shukotsu.scores.paired_statistics import LEVEL
from shukotsu.study import findings, plan_file, verdict
from shukotsu.study.model import paper_skeleton
from shukotsu.translation import N_, listed, ngettext, tr, word

if TYPE_CHECKING:
    from shukotsu.tables.rows import JointCentresRow, ModelDifferencesRow

ALL_DIGITS = ""
PRIOR = "prior-only"
TRUTH, LEFT_OUT, REPLAY = "error_mm", "left_out_mean_mm", "replay_mean_mm"
METRICS = (TRUTH, "true_tip_mean_mm", LEFT_OUT, REPLAY)
"""Metrics in model_values, the best criterion for a skeleton first; a replay's error is not a criterion."""


@dataclass(frozen=True)
class JudgedModels:
    """One metric of the study's models, over all digits.

    held_out : whether it was computed from held-out recordings. values : by model, then by subject.
    references : those of the models that are not in the study file. differences : rows of model_differences.
    """

    metric: str
    held_out: bool
    values: dict[str, dict[str, float]]
    references: frozenset[str]
    differences: list[ModelDifferencesRow]

    @property
    def judges(self) -> bool:
        """Whether the metric judges a skeleton by the truth, or by a recording that it was not made from."""
        return self.metric not in (LEFT_OUT, REPLAY) or (self.metric == LEFT_OUT and self.held_out)


def judged_models(results: StudyResults) -> list[JudgedModels]:
    """Return the available metrics in the order of METRICS."""
    judged = []
    for metric in METRICS:
        key = metric, ALL_DIGITS
        rows = [row for row in results.rows.model_values if (row["metric"], row["digit"]) == key]
        values: dict[str, dict[str, float]] = defaultdict(dict)
        for row in rows:
            if row["value"] is not None:
                values[row["model"]][row["subject"]] = row["value"]
        if results.models.keys().isdisjoint(values):
            continue
        references = frozenset(row["model"] for row in rows if row["reference"])
        compared = [row for row in results.rows.model_differences if row["n_compared_subjects"]]
        differences = [row for row in compared if (row["metric"], row["digit"]) == key]
        judged.append(JudgedModels(metric, rows[0]["held_out"], dict(values), references, differences))
    return judged


def model_to_take(results: StudyResults) -> str:
    """Return a sentence that recommends a model and states why."""
    leading = results.leading
    if results.hands and results.suspect >= {*results.hands}:
        return tr("Resolve the findings first: every hand has at least one, so no model can be evaluated.")
    verdicts = [row["verdict"] for row in results.judging.rows.joint_centres if row["model"] == leading]
    if verdicts and verdict.BELIEVE not in verdicts:
        return tr(
            "No joint can be believed, so no model is recommended: correct the problems in the report, if it "
            "lists any, or record again following the protocol (docs/protocol.md)."
        )
    judged = next((each for each in judged_models(results) if each.judges), None)
    if judged is None or leading not in judged.values:
        if results.fitted:
            return tr(
                "Use the model {model}, which fits the whole hand; no recording was held out to test it.",
                model=leading,
            )
        return tr(
            "No model can be recommended: skeletons can only be evaluated by a fit of the whole hand or "
            "against a known truth; add whole-hand to the study's models."
        )
    row = _deciding_difference(results, judged)
    if row is None:
        values = [*judged.values[leading].values()]
        claim = _amount(judged, leading, sum(values) / len(values))
        subjects = ngettext("{n} subject", "{n} subjects", len(values))
        return tr("{claim} ({test}).", claim=claim, test=subjects)
    sentence = _amount(judged, row["model"], row["mean"])
    amounts = {"other": row["other"], "amount": format_value(judged.metric, row["other_mean"])}
    if row["other"] == PRIOR:
        sentence += tr("; {amount} mm with anatomy alone, without data", **amounts)
    else:
        sentence += tr("; {amount} mm with the model {other}", **amounts)
    test = ngettext("{n} subject", "{n} subjects", row["n_compared_subjects"])
    if row["smallest_p_holm"] > LEVEL:
        test = tr("{subjects}, too few to test the difference", subjects=test)
    elif row["p_holm"] > LEVEL:
        test = tr("{subjects}; no significant difference, {p}", subjects=test, p=p_text(row["p_holm"]))
    else:
        test = tr("{subjects}; {p} after Holm's correction", subjects=test, p=p_text(row["p_holm"]))
    return tr("{claim} ({test}).", claim=sentence, test=test)


def _deciding_difference(results: StudyResults, judged: JudgedModels) -> ModelDifferencesRow | None:
    """Return the difference between the recommended model and the best other one, or None if not compared."""
    ours = [row for row in judged.differences if row["model"] == results.leading]
    if not ours:
        return None
    paper = paper_skeleton(results.models.values())
    row = min(ours, key=lambda row: (round(row["other_mean"], 6), row["other"] != paper))
    if row["mean_difference"] > 0 and row["p_holm"] <= LEVEL:
        pair = row["other"], row["model"]
        return next(each for each in judged.differences if (each["model"], each["other"]) == pair)
    return row


def taken_model(results: StudyResults) -> str:
    """Return the model that `model_to_take` recommends, or else the leading one."""
    judged = next((each for each in judged_models(results) if each.judges), None)
    row = None if judged is None else _deciding_difference(results, judged)
    return results.leading if row is None else str(row["model"])


_CLAIMS = {
    TRUTH: N_("Use the model {model}: its joints are {mean} mm from the true ones on average"),
    "true_tip_mean_mm": N_(
        "Use the model {model}: its fingertips are {mean} mm from the true ones on average"
    ),
    LEFT_OUT: N_(
        "Use the model {model}: its mean error at fingertip receivers left out of the fit is {mean} mm"
    ),
}


def _amount(judged: JudgedModels, model: str, mean: float) -> str:
    return tr(_CLAIMS[judged.metric], model=model, mean=format_value(judged.metric, mean))


class BigNumber(NamedTuple):
    """A number with its unit; of : a phrase that states what it is."""

    value: str
    unit: str
    of: str


def used_text(results: StudyResults) -> str:
    """Return a phrase that states how many recordings were used and whether they are simulated."""
    statuses = Counter(results.status_of(recording)[0] for recording in results.recordings)
    used = [each for each in results.recordings if results.status_of(each)[0] == "used"]
    in_doubt = sum(each.hand in results.suspect for each in used)
    others = [f"{count} {word(status)}" for status, count in sorted(statuses.items()) if status != "used"]
    if in_doubt:
        others.append(tr("{n} left out of all statistics because of findings", n=in_doubt))
    total = ngettext("{n} recording", "{n} recordings", len(results.recordings))
    text = tr("{n} of {total} used", n=len(used) - in_doubt, total=total)
    text += f" ({listed(others)})" if others else ""
    return text + (tr("; all data are simulated, and no person was measured") if results.simulated else "")


def big_numbers(results: StudyResults) -> tuple[BigNumber, BigNumber, BigNumber]:
    """Return the number of believed joints, the typical error of a joint, and the number of suspect hands."""
    model = results.leading
    every = [row for row in results.judging.rows.joint_centres if row["model"] == model]
    rows = [row for row in every if row["reason"] != verdict.NOT_WORN]
    hands = hands_counted(results, len({hand_of(row) for row in every}))
    believed = sum(row["verdict"] == verdict.BELIEVE for row in rows)
    total = ngettext("{n} joint", "{n} joints", len(rows))
    of_joints = tr("can be believed: {model} solved no joint of a hand without findings", model=model)
    if every:
        of_joints = tr(
            "can be believed under the model {model} (all joints of {hands})", model=model, hands=hands
        )
    if unworn := len(every) - len(rows):
        of_joints += tr("; joints without a receiver, not counted: {n}", n=unworn)
    suspects = len({hand_of(row) for row in results.findings})
    several = 1 if 1 in (suspects, len(results.hands)) else 2  # 1 of 4 hands has, 0 of 1 hand has
    mistaken = ngettext("has recordings with a mistake", "have recordings with a mistake", several)
    return (
        BigNumber(str(believed), tr("of {total}", total=total), of_joints),
        _typical_error(results, model, rows, total),
        BigNumber(
            str(suspects),
            tr("of {total}", total=hands_counted(results, len(results.hands))),
            mistaken + (tr(", left out of statistics unless accepted") if suspects else ""),
        ),
    )


def _typical_error(results: StudyResults, model: str, rows: list[JointCentresRow], total: str) -> BigNumber:
    """Return the median stated error of the joints, or a dash if none is derived from recordings."""
    stated = [row for row in rows if row["sd_mm"] is not None]
    if not rows:
        return BigNumber(DASH, "", tr("no typical error can be stated, because no joint is counted"))
    if all(verdict.BY_ANATOMY in verdict.doubts_of(row) for row in stated):
        return BigNumber(DASH, "", tr("the recordings determine the error of none of {total}", total=total))
    text = N_("is the typical stated error of a joint centre: the median over {n} of {total}, 1 sigma in 3-D")
    typical = tr(text, n=len(stated), total=total)
    for judged in judged_models(results):
        if judged.metric == TRUTH and model in judged.values:
            values = list(judged.values[model].values())
            truth = format_value(TRUTH, sum(values) / len(values))
            typical += tr(
                "; the true error, known from the simulation, is {truth} mm on average", truth=truth
            )
    return BigNumber(format_value("sd_mm", median(row["sd_mm"] for row in stated)), "mm", typical)


def hands_counted(results: StudyResults, n: int) -> str:
    """Return the number of hands as text, or of sides of a body if a layout is not of a hand."""
    if all(layout.is_hand for layout in results.layouts.values()):
        return ngettext("{n} hand", "{n} hands", n)
    return ngettext("{n} side", "{n} sides", n)


def numbers_texts(results: StudyResults) -> list[str]:
    """Return the three numbers as sentences."""
    return [
        tr("{value} {unit} {of}.", **number._asdict())
        if number.unit
        else tr("{of}.", of=number.of.capitalize())
        for number in big_numbers(results)
    ]


MOST_REASONS = 3
"""Largest number of reasons in a sentence."""

_MOVEMENTS = {
    "thumb_cmc": N_("record large circles of the thumb, from its base, for 10 s"),
    "thumb_(mcp|ip)": N_("bend and straighten the thumb alone for 10 s"),
    "(index|middle|ring|little)_(mcp|pip|dip)": N_("bend and straighten the {digit} finger alone for 10 s"),
}
"""Movement to record to determine joints better, by a pattern of the joints' names."""
_MOVED_MORE = (verdict.MOVED_LITTLE, verdict.UNCERTAIN, verdict.ONE_WAY, verdict.AXIS)
_WORN_MORE = (verdict.NO_POSE, verdict.ONE_RECEIVER)


def doubted_joints(results: StudyResults) -> list[JointCentresRow]:
    """Return the rows of joints that are not believed, under the leading model.

    Joints without a receiver and joints of suspect hands are left out.
    """
    rows = (row for row in results.judging.rows.joint_centres if row["model"] == results.leading)
    return [row for row in rows if row["verdict"] != verdict.BELIEVE and row["reason"] != verdict.NOT_WORN]


def care_line(results: StudyResults) -> str:
    """Return a sentence on the joints to take with care and why, the most frequent reason first, or "".

    Joints that were not solved are left out: there is nothing to take, and the problems state why.
    """
    of_reason: dict[str, list[JointCentresRow]] = defaultdict(list)
    for row in doubted_joints(results):
        if row["reason"] != verdict.NOT_SOLVED:
            of_reason[row["reason"]].append(row)
    n_hands = len({hand_of(row) for row in results.judging.rows.joint_centres})
    parts = []
    for rows in sorted(of_reason.values(), key=len, reverse=True)[:MOST_REASONS]:
        counts = Counter(row["joint"] for row in rows)
        joints = [
            word(joint) if n == n_hands else tr("{joint} (in {n} of {all})", joint=joint, n=n, all=n_hands)
            for joint, n in counts.items()
        ]
        worst = max(rows, key=lambda row: row["sd_mm"] or 0.0)
        parts.append(": ".join([listed(joints), *belief.reasons_of(worst)[:1]]))
    return tr("Use with care: {joints}.", joints="; ".join(parts)) if parts else ""


def next_step(results: StudyResults) -> str:
    """Return a sentence on the action that would improve the joints most, or an empty string.

    Actions are ranked by the sum, over the joints that they improve, of the error in excess of `wanted_mm`.
    """
    if results.findings:
        return tr("Next: correct the mistakes found in the recordings, and run again.")
    missed_mm: dict[str, float] = defaultdict(float)
    served: dict[str, dict[str, None]] = defaultdict(dict)
    doubted = doubted_joints(results)
    plans = {hand: results.paths.plan(*hand.who) for hand in map(hand_of, doubted)}
    measured = {
        hand
        for hand, plan in plans.items()
        if not plan.is_file() or plan_file.read_plan(plan).sizes_mm["hand_length_mm"] is not None
    }
    for row in doubted:
        hand = hand_of(row)
        wanted_mm = results.layouts[hand].wanted_mm
        if action := _action(row, is_measured=hand in measured):
            missed_mm[action] += max((row["sd_mm"] or 2 * wanted_mm) - wanted_mm, 0.0)
            served[action][row["joint"]] = None
    if missed_mm:
        action = max(missed_mm, key=lambda each: missed_mm[each])
        joints = [*served[action]]
        return tr("Next: {action}; this would improve {joints}.", action=action, joints=joints)
    gains = [row for row in results.rows.gains if row["model"] == results.leading and hand_of(row) in plans]
    best = sorted(gains, key=lambda row: row["mean_sd_after_mm"] - row["mean_sd_before_mm"])[:1]
    return tr("Next: {action}", action=belief.gain_lines(best)[0]) if best else ""


def _action(row: JointCentresRow, *, is_measured: bool) -> str:
    """Return the remedy for a joint's doubts, or an empty string if none is known.

    is_measured : whether the length of its hand is.
    """
    for kind, values in verdict.doubts_of(row).items():
        segments: Any = values.get("segments")
        if kind in _WORN_MORE and segments:
            return tr("wear a receiver on {segments}, and record again", segments=segments)
        if kind == verdict.HALVES:
            return tr(
                "tape the receivers on both sides of {joint} firmly, and record again", joint=row["joint"]
            )
        if kind == verdict.BY_ANATOMY and not is_measured:
            return tr("measure the hand's length (participants.tsv, column hand_length_mm)")
        if kind in _MOVED_MORE:
            for joints, sentence in _MOVEMENTS.items():
                if re.fullmatch(joints, row["joint"]):
                    return tr(sentence, digit=row["joint"].partition("_")[0])
    return ""


WIDTH, MOST_PROBLEMS = 79, 3
"""Width of the text on a terminal, and the largest number of problems listed there."""


def outcome_text(results: StudyResults) -> str:
    """Return the study's outcome as plain text: numbers, recommendation, and the most severe problems."""
    problems = provenance.all_problems(results)
    lines = [f"Study {results.name}: {used_text(results)}.", *numbers_texts(results), model_to_take(results)]
    lines += filter(None, [care_line(results), next_step(results)])
    for problem in problems[:MOST_PROBLEMS]:
        places = f" ({problem.places})" if problem.places else ""
        lines.append(f"- {problem.where}: {findings.in_quotes(problem.text)}{places}")
    more = len(problems) - MOST_PROBLEMS
    lines += [f"- and {more} more; see the report"] if more > 0 else []
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ", break_on_hyphens=False) for line in lines
    )
