"""Write a page's opening: which joints to believe and what to do next; then how good the skeletons are."""

from __future__ import annotations

from collections import Counter
from statistics import median

from shukotsu.schemas.model import the_papers
from shukotsu.schemas.study import Hand
from shukotsu.sentences.translation import listed, ngettext, tr
from shukotsu.stages.report.belief import BELIEFS, BELIEVED, CARE, NOT, belief, joints_text
from shukotsu.stages.report.next_step import hands_counted, hands_text, next_step
from shukotsu.stages.report.score_tables import mean, tasks_text
from shukotsu.stages.report.study_results import LEAST_SQUARES, Row, StudyResults, hand_of, row_key
from shukotsu.stages.report.table_cells import number
from shukotsu.stages.report.trust import study_beliefs
from shukotsu.stages.report.truth_tables import FAR_MM, known

FEW_MODELS = 2
MIDDLE_OF = 3
"""From so many hands on, what holds of most is told."""


def used_text(results: StudyResults) -> str:
    """Say in a sentence how many of the recordings were used."""
    statuses = Counter(results.status_of(recording)[0] for recording in results.recordings)
    total = len(results.recordings)
    others = [
        tr("{count} {status}", count=count, status=status)
        for status, count in sorted(statuses.items())
        if status != "used"
    ]
    rest = f" ({listed(others)})" if others else ""
    return ngettext(
        "{n} of {recordings} was used{rest}.",
        "{n} of {recordings} were used{rest}.",
        statuses["used"],
        recordings=ngettext("{n} recording", "{n} recordings", total),
        rest=rest,
    )


def opening(results: StudyResults) -> str:
    """The first sentences of a study's or a subject's page: which joints, how good, and what to do next."""
    judging, model = results.judging, results.leading
    rows = [row for row in judging.joints if row["model"] == model]
    found, judged = study_beliefs(judging, model), {hand_of(row) for row in rows}
    if not found:
        return f"{_nothing_judged(results, model)} {next_step(results)}".rstrip()
    of = {each: [joint for joint, own in found.items() if own == each] for each in BELIEFS}
    sds = [row["sd_mm"] for row in rows if belief(row) == BELIEVED and row["sd_mm"] is not None]
    known = tr(", typically to {sds:.1f} mm", sds=median(sds)) if sds else ""
    text = tr(
        "{n_of} of {joints} can be believed{where}",
        n_of=len(of[BELIEVED]) or tr("None"),
        joints=ngettext("{n} joint", "{n} joints", len(found)),
        where=_where(results, len(judged)),
    )
    text += tr(", as {model} places them{known}", model=model, known=known)
    text += tr(": {names}.", names=joints_text(of[BELIEVED])) if of[BELIEVED] else tr(".")
    text += tr(" With care: {of}.", of=joints_text(of[CARE])) if of[CARE] else ""
    text += tr(" Not: {of}.", of=joints_text(of[NOT])) if of[NOT] else ""
    return f"{_how_many_judged(results, judged)}{text} {next_step(results)}".rstrip()


def _nothing_judged(results: StudyResults, model: str) -> str:
    """Why no joint is judged: every hand is suspect, or none has a joint at all."""
    if not results.hands:
        return tr("There is no recording, so nothing is judged.")
    total = hands_counted(results, len(results.hands))
    if results.suspect >= {*results.hands}:
        return tr(
            "Nothing is judged: what was found in the recordings leaves everything out ({total}).",
            total=total,
        )
    text = tr("No joint was solved under {model}: {total}.", model=model, total=total)
    return text + _left_out_text(results)


def _how_many_judged(results: StudyResults, judged: set[Hand]) -> str:
    """Say how many hands the text is about, where it is not about all."""
    if len(judged) == len(results.hands):
        return ""
    unsolved = len({*results.hands} - judged - results.suspect)
    text = tr(
        "Judged: {n} of {total}.", n=len(judged), total=hands_counted(results, len(results.hands))
    ) + _left_out_text(results)
    text += tr(" Without a joint: {unsolved}.", unsolved=unsolved) if unsolved else ""
    return text + " "


def _left_out_text(results: StudyResults) -> str:
    """Say how many hands are left out for what was found in their recordings; empty where none is."""
    n = len(results.suspect)
    return tr(" Left out for what was found in their recordings: {n}.", n=n) if n else ""


def _where(results: StudyResults, judged: int) -> str:
    """In how many hands a joint has to be believed to be called so."""
    if judged < MIDDLE_OF:
        both = tr(" in both hands") if results.of_hands else tr(" on both sides")
        return both if judged == 2 else ""
    return tr(" in most of {hands}", hands=hands_counted(results, judged))


def headline(results: StudyResults) -> str:
    """One paragraph: of a model that fits the whole hand where there is one, else of all.

    Hands with a suspect finding are counted out, and that is said.
    """
    used = used_text(results)
    if results.simulated:
        used = used.rstrip(".") + tr("; they are simulated, so no person's hand is behind these numbers.")
    if results.suspect:
        used += tr(
            " Left out of these numbers, for what was found in their recordings: {hands}.",
            hands=hands_text(hand for hand in results.hands if hand in results.suspect),
        )
        if results.suspect >= {*results.hands}:
            return used
    results = results.judging
    for model in results.fitted[:1]:
        rows, scored_on = _judging(results, model)
        if known(rows, "left_out_mean_mm"):
            sentences = [_left_out(results, model, rows, scored_on), _against_truth(results, model)]
            return " ".join([used, *filter(None, sentences)])
    return f"{used} {_closing(results)}"


def mean_tip_errors(results: StudyResults, *, held_out: bool) -> dict[str, float]:
    """Mean of the digits' mean tip errors, mm, by model; models without any are left out."""
    means = {}
    for model in results.models:
        found = mean(
            row["mean_mm"]
            for row in results.tip_errors
            if (row["model"], row["binding"], row["held_out"]) == (model, LEAST_SQUARES, held_out)
        )
        if found is not None:
            means[model] = found
    return means


def _judging(results: StudyResults, model: str) -> tuple[list[Row], str]:
    """The model's scores that judge it, held-out ones if there are any, and on what, in words."""
    rows = [row for row in results.scores if row["model"] == model]
    held_out = [row for row in rows if row["held_out"]]
    if held_out:
        return held_out, tr("On recordings that it was not made from")
    return rows, tr("On the recordings that it was made from (nothing is held out)")


def _left_out(results: StudyResults, model: str, rows: list[Row], scored_on: str) -> str:
    missed = number(mean(row["left_out_mean_mm"] for row in rows))
    recordings = {row_key(row) for row in rows}
    prior = mean(
        row["left_out_mean_mm"]
        for row in results.scores
        if row["model"] == "prior-only" and row_key(row) in recordings
    )
    beside = "" if prior is None else tr(" (anatomy alone, without data: {prior} mm)", prior=number(prior))
    return tr(
        "{scored_on}, {model} misses the distal receivers, whose positions it was not told, by "
        "{missed} mm on average{beside}.",
        scored_on=scored_on,
        model=model,
        missed=missed,
        beside=beside,
    )


def _against_truth(results: StudyResults, model: str) -> str:
    """Compare the model's joints with the true ones, beside the paper's; empty without a truth."""
    mine = _joint_errors(results, model)
    if not mine:
        return ""
    made_from = _made_from(results, model)
    text = tr(
        "Made from {made_from}, its joints are {mine} mm from the true ones in the median and "
        "{far} are more than {FAR_MM:.0f} mm off",
        made_from=made_from,
        mine=number(median(mine), 1),
        far=_far(mine),
        FAR_MM=FAR_MM,
    )
    paper = the_papers(results.models.values())
    theirs = _joint_errors(results, paper) if paper else []
    if not theirs:
        return text + "."
    others = _made_from(results, paper)
    skeleton = (
        paper if others == made_from else tr("{paper} (made from {others})", paper=paper, others=others)
    )
    return tr(
        "{text}; those of {skeleton} {theirs} mm and {far}.",
        text=text,
        skeleton=skeleton,
        theirs=number(median(theirs), 1),
        far=_far(theirs),
    )


def _judged_skeletons(results: StudyResults, model: str) -> set[tuple[Hand, str]]:
    """Hand and calibrated_on of the model's skeletons that are judged."""
    rows, _ = _judging(results, model)
    return {(hand_of(row), row["calibrated_on"]) for row in rows}


def _joint_errors(results: StudyResults, model: str) -> list[float]:
    judged = _judged_skeletons(results, model)
    return known(
        [
            row
            for row in results.joint_errors
            if row["model"] == model and (hand_of(row), row["calibrated_on"]) in judged
        ],
        "error_mm",
    )


def _made_from(results: StudyResults, model: str) -> str:
    tasks = {tasks_text(calibrated_on) for _, calibrated_on in _judged_skeletons(results, model)}
    return " or ".join(sorted(tasks))


def _far(errors: list[float]) -> str:
    return tr("{n_far} of {n_errors}", n_far=sum(error > FAR_MM for error in errors), n_errors=len(errors))


def _closing(results: StudyResults) -> str:
    """Describe models' tip errors in replays: held-out ones if there are any, of many models the range."""
    held_out, seen = mean_tip_errors(results, held_out=True), mean_tip_errors(results, held_out=False)
    means = held_out or seen
    if not means:
        return tr("No tip error could be computed with any model.")
    ordered = sorted(means, key=lambda model: means[model])
    shown = ordered if len(ordered) <= FEW_MODELS else [ordered[0], ordered[-1]]
    amounts = [tr("{means} mm ({model})", means=number(means[model]), model=model) for model in shown]
    many = len(ordered) > FEW_MODELS
    by = tr("between {amounts}", amounts=listed(amounts)) if many else listed(amounts)
    recordings = (
        tr("held-out recordings (the joints were solved from others)")
        if held_out
        else tr("the recordings that the joints were solved from (nothing is held out)")
    )
    return tr(
        "On {recordings} the replayed tip misses its receiver by {by} on average, which "
        "says how well the joints close and not where they are.",
        recordings=recordings,
        by=by,
    )
