"""The page of the study: what it found, model against model, its subjects, and where everything else is."""

from __future__ import annotations

from collections import Counter
from typing import Any

from markupsafe import Markup

from shukotsu.schemas.results import STUDY_FIGURES
from shukotsu.schemas.study import Hand, Study, path_token
from shukotsu.sentences.messages import translated
from shukotsu.sentences.translation import full_name, ngettext, tr, word
from shukotsu.stages.report import provenance
from shukotsu.stages.report.headline import headline, opening, used_text
from shukotsu.stages.report.links import Link, anchor, link, recording_links
from shukotsu.stages.report.methods_text import REFERENCES, methods_text
from shukotsu.stages.report.models_compared.sections import models_compared
from shukotsu.stages.report.movement_results import Movement
from shukotsu.stages.report.plots.hand import JointLink
from shukotsu.stages.report.plots.page_pictures import page_picture, taken_failures
from shukotsu.stages.report.print_figures.movement import ranges_panel
from shukotsu.stages.report.score_tables import held_out_table, mean
from shukotsu.stages.report.skeleton_stills import index_figure, posed_hands
from shukotsu.stages.report.skeleton_tables import lengths_table
from shukotsu.stages.report.study_results import Row, StudyResults, hand_of
from shukotsu.stages.report.table_cells import DASH, Block, DataTable, number
from shukotsu.stages.report.templates import render
from shukotsu.stages.report.trust import believed_text, study_beliefs, study_trust_table

FEW_HANDS = 30
"""As many rows as are shown unfolded."""


def render_study(results: StudyResults, study: Study, movement: Movement | None = None) -> str:
    """Give the study's page; the same results give the same text."""
    compared = models_compared(results)
    return render(
        "study.html.j2",
        study=results.name,
        headline=headline(results),
        used=used_text(results),
        front=_front(results),
        findings=provenance.found(results.findings),
        accepted=provenance.found(results.accepted),
        opening=opening(results),
        movement=_movement(movement),
        exports=study.exports,
        exported=exported_files(results),
        figures=figure_files(results),
        export_models=study.export_settings["models"],
        compared=compared,
        subjects=subjects_table(results),
        lengths=lengths_table(results, results.leading),
        lengths_open=len(results.hands) <= FEW_HANDS,
        trust=study_trust_table(results, results.leading),
        model=results.leading,
        held_out=held_out_table(results),
        recordings=provenance.recordings_table(results),
        models=provenance.models_table(results),
        methods=methods_text(results, movement),
        references=REFERENCES,
        versions=provenance.versions_table(),
        inputs=provenance.inputs_table(results),
        config=provenance.config_text(study),
        problems=_problems(results),  # after every picture
    )


def _problems(results: StudyResults) -> DataTable | None:
    """All problems, those of pictures that could not be drawn among them."""
    for message in taken_failures():
        results.add_problem("report", message)
    return provenance.problems_table(results)


def _movement(movement: Movement | None) -> dict[str, Any] | None:
    """The ranges of motion as a picture, and which numbers differ between levels of a factor."""
    if movement is None or movement.ranges.empty:
        return None
    return {"picture": page_picture(ranges_panel(movement)), "differences": movement.differences_table()}


def _front(results: StudyResults) -> dict[str, Any] | None:
    """The first hand that is judged and has a picture, as an index of the study's joints, or None."""
    beliefs = study_beliefs(results.judging, results.leading)
    entries = {
        joint: JointLink(
            believed,
            f"#joint-{path_token(joint)}",
            tr("{joint}: {believed}, in most hands", joint=full_name(joint), believed=tr(believed)),
        )
        for joint, believed in beliefs.items()
    }
    for who in results.sessions:
        posed = [item for item in posed_hands(results, who).hands if item.hand not in results.suspect]
        if posed and entries:
            links = recording_links(results.shown, results.paths, results.paths.report, who)
            index = index_figure(posed[-1], results.leading, entries)
            return {"subject": who.label, "index": index, "links": links}
    return None


def exported_files(results: StudyResults) -> dict[str, list[Link]]:
    """Links to the files in the folder of exports, by what their names end in; to folders there as such."""
    found: dict[str, list[Link]] = {}
    folder = results.paths.exports
    for file in sorted(folder.glob("[!.]*")):  # what begins with a dot is Snakemake's
        if not file.name.endswith(".failed.txt"):
            kind = "folders" if file.is_dir() else file.suffix.removeprefix(".")
            found.setdefault(kind, []).append(link(file.name, results.paths.report, file))
    return found


def figure_files(results: StudyResults) -> list[tuple[str, list[Link]]]:
    """Links to the study's figures for print, where they are made: they stand beside the report."""
    folder, page = results.paths.report.parent / "figures", results.paths.report
    kinds = ("svg", "pdf", "txt")
    return [(name, [link(kind, page, folder / f"{name}.{kind}") for kind in kinds]) for name in STUDY_FIGURES]


def render_failure(message: str) -> str:
    """Give a page that says only why there is no report."""
    return render(
        "failure.html.j2",
        title=tr("No report"),
        message=tr("The report could not be made: {message}", message=translated(message)),
    )


def subjects_table(results: StudyResults) -> DataTable:
    """A row for every hand, with links to the subject's page and to those of its recordings."""
    model = results.leading
    scores: dict[Hand, list[Row]] = {}
    for row in results.scores:
        if row["model"] == model:
            scores.setdefault(hand_of(row), []).append(row)
    truth = any(row["true_tip_mean_mm"] is not None for rows in scores.values() for row in rows)
    fitted = model in results.fitted
    header: tuple[str, ...] = (
        tr("Subject"),
        tr("Hand"),
        tr("See it move"),
        tr("Recordings"),
        tr("Joints to believe"),
    )
    header += (tr("Distal receivers left out [mm]"),) if fitted else ()
    header += (tr("Fingertip against the truth [mm]"),) if truth else ()
    rows = tuple(
        (*_who(results, hand), believed_text(results, hand, model))
        + ((_score_of(scores.get(hand, []), "left_out_mean_mm"),) if fitted else ())
        + ((_score_of(scores.get(hand, []), "true_tip_mean_mm"),) if truth else ())
        for hand in results.hands
    )
    return DataTable(
        tr(
            "Every hand of the study; the numbers are those of {model}, means over digits (held-out "
            "scores where there are any).",
            model=model,
        ),
        (Block(header, rows),),
        (),
        frozenset(range(4)),
    )


def _who(results: StudyResults, hand: Hand) -> tuple[str, ...]:
    page = results.paths.report
    links = recording_links(results.shown, results.paths, page, hand.who, hand.hand)
    return (
        anchor(link(hand.who.label, page, results.paths.subject_page(*hand.who))),
        word(hand.hand),
        Markup(", ").join(anchor(each) for each in links) if links else DASH,
        _recordings(results, hand),
    )


def _recordings(results: StudyResults, hand: Hand) -> str:
    """Say how many of the hand's recordings were used, and why the others were not."""
    mine = [recording for recording in results.recordings if recording.hand == hand]
    statuses = [results.status_of(recording) for recording in mine]
    used = sum(status == "used" for status, _ in statuses)
    if used == len(mine):
        return ngettext("{n} recording", "{n} recordings", used)
    reasons = Counter(
        ": ".join(filter(None, (word(status), translated(why))))
        for status, why in statuses
        if status != "used"
    )
    texts = "; ".join(f"{why} ({count}×)" if count > 1 else why for why, count in reasons.items())
    return tr(
        "◆ {used} of {recordings}; {texts}",
        used=used,
        recordings=ngettext("{n} recording", "{n} recordings", len(mine)),
        texts=texts,
    )


def _score_of(rows: list[Row], name: str) -> str:
    fresh = [row for row in rows if row["held_out"]] or rows
    return number(mean(row[name] for row in fresh))
