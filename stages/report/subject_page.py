"""The page of one subject: what its skeletons are worth, and every number behind them."""

from __future__ import annotations

from typing import Any

from schemas.study import Hand
from stages.report import provenance
from stages.report.headline import used_text
from stages.report.links import link, recording_links
from stages.report.next_recording import next_recording
from stages.report.paper_tables import (
    SLIPS,
    is_the_papers_hand,
    least_squares_table,
    own_table,
    printed_table,
    table_title,
)
from stages.report.score_tables import digit_tables, score_table
from stages.report.skeleton_stills import skeleton_pictures
from stages.report.skeleton_tables import bone_table, joint_tables, receiver_tables
from stages.report.study_results import StudyResults, Trial
from stages.report.table_cells import Folded
from stages.report.templates import render
from stages.report.trust import trust_table
from stages.report.truth_tables import joint_error_tables, truth_table


def render_subject(results: StudyResults) -> str:
    """Give the page of the one subject that `results` is of; the same results give the same text.

    Its only link to other subjects is that to the study's page: were they named here, one subject more
    would make the others' pages anew.
    """
    (who,) = results.sessions
    hands = results.hands_of(*who)
    page = results.paths.subject_page(*who)
    return render(
        "subject.html.j2",
        study=results.name,
        to_study=link(results.name, page, results.paths.report),
        recordings=recording_links(results.shown, results.paths, page, who),
        used=used_text(results),
        findings=provenance.findings(results),
        problems=provenance.problems_table(results, f"as the study asked: {who}"),
        name=who.label,
        trust=[_trust_part(results, hand) for hand in hands],
        truth=truth_table(results, who),
        joint_errors=joint_error_tables(results, who),
        next_recording=[next_recording(results, hand) for hand in hands],
        trials=[_trial_part(results, trial) for trial in results.trials(*who)],
        skeletons=skeleton_pictures(results, who),
        joints=[folded for hand in hands for folded in joint_tables(results, hand)],
        bones=[bone_table(results, hand) for hand in hands],
        receivers=[folded for hand in hands for folded in receiver_tables(results, hand)],
        model=results.leading,
        fitted=results.fitted,
        simulated=results.simulated,
        slips=SLIPS,
        sheet=provenance.recordings_table(results, f"of {who}"),
        inputs=provenance.inputs_table(results, f"of {who}"),
    )


def _trust_part(results: StudyResults, hand: Hand) -> dict[str, Any]:
    """One hand: its joints in words, of the leading model and, folded, of the others."""
    others = [name for name in results.models if name != results.leading]
    return {
        "hand": f"{hand.hand.capitalize()} hand",
        "leading": trust_table(results, hand, results.leading),
        "others": [Folded(name, trust_table(results, hand, name)) for name in others],
    }


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
    return {
        "title": trial.title,
        "scores": score_table(results, trial),
        "digits": digit_tables(results, trial),
        "pairs": pairs,
        "least_squares": least_squares_table(results, trial),
    }
