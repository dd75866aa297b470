"""The page of one subject: its hands, verdicts on joints, scores, the paper's tables and bone lengths."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from shukotsu import command_line
from shukotsu.errors import InputError
from shukotsu.report import belief, judged_models, provenance, score_tables, skeleton_tables
from shukotsu.report.figures.drawing import hand_panel, page_picture, taken_failures
from shukotsu.report.figures.study_figures import lengths_panel
from shukotsu.report.recording_page import failure_page, recording_links, recording_page, recording_title
from shukotsu.report.recording_results import read_recording, read_still
from shukotsu.report.score_tables import printed_table
from shukotsu.report.study_page import render_failure
from shukotsu.report.study_results import StudyResults, Trial, read_subject
from shukotsu.report.table_cells import Folded, link
from shukotsu.report.templates import check_language, languages, render, speaking
from shukotsu.study.plan_file import plan_of_results
from shukotsu.study.results import FAILED_PAGES
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import RANGES_OF_MOTION
from shukotsu.tables.parts import opened_once
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.whole_files import write_text
from shukotsu.translation import tr, translated


def render_subject(results: StudyResults) -> str:
    """Return the page of the only subject in `results` as HTML; the same results give the same text.

    The page links to the study's page but not to other subjects, because adding a subject would then change
    the pages of the others.
    """
    (who,) = results.sessions
    hands, page = results.hands_of(*who), results.paths.subject_page(*who)
    lengths = lengths_panel(results, who, results.leading)
    shared = skeleton_tables.lengths_are_shared(results, hands, results.leading)
    return render(
        "subject.html.j2",
        tables_at=f"../../{quote(results.paths.subject(*who).name)}/",
        study=results.name,
        to_study=link(results.name, page, results.paths.report),
        recordings=recording_links(results, page, who),
        opening=" ".join(judged_models.numbers_texts(results)),
        used=judged_models.used_text(results),
        problems=provenance.all_problems(results),
        accepted=provenance.faults_listed(results.accepted),
        name=who.label,
        model=results.leading,
        hands=[_hand_part(results, hand) for hand in reversed(hands)],
        trials=[_trial_part(results, trial) for trial in results.trials(*who)],
        truth=score_tables.truth_table(results, who),
        lengths=page_picture(lengths) if lengths else "",
        shared=tr(skeleton_tables.SHARED) if shared else "",
        folded=_folded_tables(results, who),
    )


def _hand_part(results: StudyResults, hand: Hand) -> dict[str, Any]:
    """Return a hand's section: picture, joints under every model, the leading one first, and next steps."""
    model = results.leading
    caption, still = _still(results, hand)
    rows, gains = results.joints_of.get((hand, model), []), results.gains_of.get((hand, model), [])
    tables = []
    for name in (model, *(name for name in results.models if name != model)):
        counts = belief.believed_counts(results.joints_of.get((hand, name), []))
        tables.append(Folded(f"{name}: {counts}", belief.joint_table(results, hand, name)))
    return {
        "name": tr("{hand} hand", hand=hand.hand.capitalize()),
        "caption": caption,
        "still": still,
        "leading": tables[0],
        "others": tables[1:],
        "near": belief.near_lines(rows, gains, results.layouts[hand]),
        "next": [] if hand in results.suspect else belief.gain_lines(gains),  # first resolve its findings
    }


def _still(results: StudyResults, hand: Hand) -> tuple[str, Markup]:
    """Return a caption and a still picture of the hand from its first recording that has a frame to show.

    If there is none, the caption states why.
    """
    name, reasons = tr("{hand} hand", hand=hand.hand.capitalize()), []
    recordings = [each for each in results.shown if each.hand == hand]
    for recording in sorted(recordings, key=lambda each: each.role == "calibration"):
        try:
            motion = read_still(results, recording, results.leading)
        except InputError as error:
            reasons.append(translated(error.message))
            continue
        title = tr("Skeleton of {hand}, {model}.", hand=hand, model=results.leading)
        return f"{name}, {recording.task}", page_picture(hand_panel(title, motion, motion.skeletons[0], 0))
    why = "; ".join(dict.fromkeys(reasons)) or tr("it has no recording in use")
    return f"{name}: {why}", Markup()


def _trial_part(results: StudyResults, trial: Trial) -> dict[str, Any]:
    """Return the section of one evaluated task: scores, if any, and the study's tables beside the paper's."""
    beside = score_tables.has_the_papers_digits(results, trial)
    return {
        "title": trial.title,
        "scores": score_tables.score_table(results, trial),
        "pairs": [
            {
                "title": score_tables.table_title(model),
                "table": score_tables.study_table(results, trial, model),
                "printed": printed_table(model.paper_table) if beside and model.paper_table else None,
            }
            for model in results.models.values()
        ],
        "least_squares": score_tables.least_squares_table(results, trial),
    }


def _folded_tables(results: StudyResults, who: SubjectSession) -> dict[str, list[Folded]]:
    """Return the folded tables by section: lengths, ranges, receivers, recordings."""
    hands = results.hands_of(*who)
    names = {hand: tr("{hand} hand", hand=hand.hand.capitalize()) for hand in hands}
    return {
        "lengths": [Folded(names[hand], skeleton_tables.bone_table(results, hand)) for hand in hands],
        "ranges": [
            Folded(names[hand], skeleton_tables.measured_table(str(hand), rows, with_recording=True))
            for hand in hands
            if (rows := results.hand_rows(RANGES_OF_MOTION, hand, results.leading))
        ],
        "receivers": [folded for hand in hands for folded in skeleton_tables.receiver_tables(results, hand)],
        "recordings": [Folded(judged_models.used_text(results), provenance.recordings_table(results))],
    }


Page = tuple[Callable[[], str], Callable[[str], str]]
"""Functions that render a page, and a page that states why the former failed."""


def write_pages(arguments: argparse.Namespace) -> None:
    """Read the subject's tables and write its pages; a page that fails is replaced by one with the reason."""
    check_language(arguments.language, "--language")
    plan = plan_of_results(arguments.plan)
    with speaking(arguments.language), opened_once() as opened:
        results = read_subject(plan, opened)
        pages: dict[Path, Page] = {Path("subject.html"): (partial(render_subject, results), render_failure)}
        for recording in results.shown:
            pages[_page(recording)] = (
                partial(_recording_page, results, recording),
                partial(failure_page, recording_title(recording)),
            )
        failures = []
        for page, (make, say_why) in pages.items():
            with command_line.keep_failure(arguments, arguments.record_failure) as messages:
                write_text(arguments.out / page, make())
            failures += [f"{page.as_posix()}: {message}" for message in taken_failures()]
            for message in messages:
                write_text(arguments.out / page, say_why(message))
                failures.append(f"{page.as_posix()}: {message}")
    _write_failures(arguments.out, failures)


def _page(recording: Recording) -> Path:
    """Return the path of the recording's page in the subject's folder of pages."""
    return Path(recording.hand.hand, f"{recording.name}.html")


def _write_failures(folder: Path, failures: Sequence[str]) -> None:
    """Write the list of failed pages to a file for the study's report, or remove the file if none failed."""
    if failures:
        write_text(folder / FAILED_PAGES, "".join(f"{line}\n" for line in failures))
    else:
        (folder / FAILED_PAGES).unlink(missing_ok=True)


def _recording_page(results: StudyResults, recording: Recording) -> str:
    return recording_page(read_recording(results, recording))


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write pages that state why there are no results; if the plan is unreadable, only the subject's page."""
    shown: list[Recording] = []
    with suppress(InputError):
        plan = plan_of_results(arguments.plan)
        shown = [recording for hand in plan.hands for recording in plan.posed(hand)]
    with speaking(arguments.language if arguments.language in languages() else "en"):
        for page in (Path("subject.html"), *map(_page, shown)):
            write_text(arguments.out / page, render_failure(message))
    _write_failures(arguments.out, [f"subject.html: {message}"])
