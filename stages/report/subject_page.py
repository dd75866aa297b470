"""The page of one subject: which joints to believe, what its skeletons are worth, and every number behind."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import full_name, tr
from shukotsu.stages.report import provenance
from shukotsu.stages.report.headline import opening, used_text
from shukotsu.stages.report.links import link, recording_links
from shukotsu.stages.report.measured_ranges import measured_ranges, measured_table
from shukotsu.stages.report.next_step import gain_lines
from shukotsu.stages.report.paper_tables import (
    SLIPS,
    is_the_papers_hand,
    least_squares_table,
    own_table,
    printed_table,
    table_title,
)
from shukotsu.stages.report.plots.hand import JointLink
from shukotsu.stages.report.score_tables import digit_tables, in_sample_table, score_table
from shukotsu.stages.report.skeleton_stills import (
    DrawnHands,
    Figure,
    index_figure,
    posed_hands,
    skeleton_pictures,
)
from shukotsu.stages.report.skeleton_tables import bone_table, receiver_tables
from shukotsu.stages.report.study_results import Row, StudyResults, Trial
from shukotsu.stages.report.table_cells import DataTable, Folded, number
from shukotsu.stages.report.templates import render
from shukotsu.stages.report.trust import (
    Verdict,
    believed_counts,
    joint_anchor,
    joint_table,
    reasons,
    verdicts,
)
from shukotsu.stages.report.truth_tables import joint_error_tables, truth_summary, truth_table


def render_subject(results: StudyResults) -> str:
    """Give the page of the one subject that `results` is of; the same results give the same text.

    Its only link to other subjects is that to the study's page: were they named here, one subject more
    would make the others' pages anew.
    """
    (who,) = results.sessions
    hands, posed = results.hands_of(*who), posed_hands(results, who)
    page = results.paths.subject_page(*who)
    return render(
        "subject.html.j2",
        study=results.name,
        to_study=link(results.name, page, results.paths.report),
        recordings=recording_links(results.shown, results.paths, page, who),
        opening=opening(results),
        used=used_text(results),
        findings=provenance.found(results.findings),
        accepted=provenance.found(results.accepted),
        problems=provenance.problems_table(results, tr("as the study asked: {who}", who=who)),
        name=who.label,
        trust=[_trust_part(results, hand, posed) for hand in reversed(hands)],
        remarks=posed.remarks,
        truth=truth_table(results, who),
        truth_said=truth_summary(results, who, results.leading),
        joint_errors=joint_error_tables(results, who),
        next_recording=[
            {"hand": tr("{hand} hand", hand=hand.hand.capitalize()), "lines": gain_lines(rows)}
            for hand in reversed(hands)
            if (rows := results.gains_of.get((hand, results.leading)))
        ],
        trials=[_trial_part(results, trial) for trial in results.trials(*who)],
        skeletons=skeleton_pictures(results, posed),
        bones=[
            Folded(tr("{hand} hand", hand=hand.hand.capitalize()), bone_table(results, hand))
            for hand in hands
        ],
        ranges=[
            Folded(
                tr("{hand} hand: {n_rows} angles of joints", hand=hand.hand.capitalize(), n_rows=len(rows)),
                _ranges_table(hand, rows),
            )
            for hand in hands
            if (rows := measured_ranges(results, hand, results.leading))
        ],
        receivers=[folded for hand in hands for folded in receiver_tables(results, hand)],
        model=results.leading,
        fitted=results.fitted,
        simulated=results.simulated,
        slips=SLIPS,
        sheet=provenance.recordings_table(results, tr("of {who}", who=who)),
        inputs=provenance.inputs_table(results, tr("of {who}", who=who)),
    )


def _ranges_table(hand: Hand, rows: list[Row]) -> DataTable:
    caption = tr("Range of motion, posture and speed of {hand}, with stated 1-sigma errors.", hand=hand)
    return measured_table(caption, rows, with_recording=True)


def _trust_part(results: StudyResults, hand: Hand, posed: DrawnHands) -> dict[str, Any]:
    """One hand: its picture as an index, the reasons for doubt, and every model's table folded."""
    model = results.leading
    found = verdicts(results, hand, model)
    tables = [
        Folded(
            f"{name}: {believed_counts(results.joints_of.get((hand, name), []))}",
            joint_table(results, hand, name),
        )
        for name in (model, *(name for name in results.models if name != model))
    ]
    return {
        "hand": tr("{hand} hand", hand=hand.hand.capitalize()),
        "index": _index(hand, model, found, posed),
        "reasons": reasons(found),
        "leading": tables[0],
        "others": tables[1:],
    }


def _index(hand: Hand, model: str, found: Iterable[Verdict], posed: DrawnHands) -> Figure | None:
    entries = {
        v.joint: JointLink(v.believed, f"#{joint_anchor(hand, v.joint, model)}", _words(v)) for v in found
    }
    drawn = (index_figure(item, model, entries) for item in posed.hands if item.hand == hand)
    return next(drawn, None) if entries else None


def _words(verdict: Verdict) -> str:
    """Write the text that a pointer on a joint of the index shows."""
    sd = verdict.row["sd_mm"]
    known = "" if sd is None else tr(", known to {sd} mm (1 sigma)", sd=number(sd))
    doubt = f"; {verdict.why}" if verdict.why else ""
    return f"{full_name(verdict.joint)}: {tr(verdict.believed)}{known}{doubt}"


def _trial_part(results: StudyResults, trial: Trial) -> dict[str, Any]:
    """One evaluated task: scores, None without any, and the study's tables beside the paper's."""
    beside = is_the_papers_hand(results, trial)
    pairs = [
        {
            "title": table_title(model),
            "own": own_table(results, trial, model),
            "printed": printed_table(model.paper_table) if beside and model.paper_table else None,
        }
        for model in results.models.values()
    ]
    in_sample = in_sample_table(results, trial)
    return {
        "title": trial.title,
        "scores": score_table(results, trial),
        "folded": [
            *(
                [Folded(tr("In-sample scores, of skeletons made with this task too"), in_sample)]
                if in_sample
                else []
            ),
            *digit_tables(results, trial),
        ],
        "pairs": pairs,
        "least_squares": least_squares_table(results, trial),
    }
