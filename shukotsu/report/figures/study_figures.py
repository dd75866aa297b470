"""A study's figures with their captions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from shukotsu.report import judged_models, movement_results, palette, recording_results
from shukotsu.report.belief import BELIEVED, CARE, NOT, UNWORN, belief, wanted_text
from shukotsu.report.figures import drawing
from shukotsu.report.figures.drawing import FOOT_MM, ROW_MM, Drawing, NoDataError, Panel, PanelRow, Scale
from shukotsu.report.figures.recording_figures import CurveLook, curve_panels, legend_handles
from shukotsu.report.figures.style import wrap_text
from shukotsu.report.judged_models import LEFT_OUT, PRIOR, REPLAY, TRUTH, JudgedModels
from shukotsu.report.movement_results import OF_ANGLE, RANGE, ComparedFactor, StudyMovement
from shukotsu.report.palette import AMBER, INK, NO, PAPER, RULE, SOFT, Look
from shukotsu.report.study_results import StudyResults, hand_of, task_title
from shukotsu.report.table_cells import QUANTITIES, alike, capital, heading
from shukotsu.scores.paired_statistics import FEWEST_SUBJECTS, paired_difference
from shukotsu.study.results import STUDY_FIGURES
from shukotsu.study.study import Study
from shukotsu.study.verdict import CARE_TIMES
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.typed_table import key_of
from shukotsu.translation import N_, listed, ngettext, tr, word

if TYPE_CHECKING:
    import pandas as pd

    from shukotsu.tables.rows import BoneLengthsRow


def of_study(results: StudyResults, study: Study) -> Iterator[Drawing]:
    """Draw the study's figures in the order of STUDY_FIGURES."""
    taken: dict[str, object] = {"results": results, "study": study}
    taken["movement"] = movement_results.read_movement(results)
    taken["groups"] = movement_results.subject_groups(study)
    for name, (function, *arguments) in STUDY_FIGURES.items():
        yield drawing.draw_figure(name, partial(globals()[function], *map(taken.__getitem__, arguments)))


_MODEL_ROW_MM = 6.0
"""Height of a row, large enough that the line through a subject's dots can be followed."""


def model_panels(results: StudyResults) -> dict[str, Panel]:
    """Return panels of the models by metric: the metrics that judge models, then the replay's error.

    The recommended model is first, and models with equal numbers share a row.
    """
    judged = {each.metric: each for each in judged_models.judged_models(results)}
    first = judged_models.taken_model(results)
    metrics = [*([TRUTH, "true_tip_mean_mm"] if TRUTH in judged else [LEFT_OUT]), REPLAY]
    looks = palette.looks(list(results.models), palette.MODELS) | {PRIOR: Look(SOFT, "o")}
    names_in_order = sorted((*results.models, PRIOR), key=lambda name: name != first)
    panels = {}
    for each in (judged[metric] for metric in metrics if metric in judged):
        rows = []
        for names in alike({name: each.values[name] for name in names_in_order if name in each.values}):
            numbers = each.values[names[0]]
            values = np.array(list(numbers.values()))
            interval = paired_difference(values).interval
            words = wrap_text(", ".join(names), drawing.ROW_LETTERS)
            rows.append(PanelRow("\n".join(words), looks[names[0]], numbers, float(values.mean()), interval))
        scale = drawing.value_scale([value for row in rows for value in row.values()])
        axis = heading(each.metric) + (tr(", log scale") if scale.kind == "log" else "")
        shown = listed(row.name.replace("\n", " ") for row in rows)
        title = tr("{quantity}, every subject under {names}.", quantity=heading(each.metric), names=shown)
        counts = [len(row.numbers) for row in rows]
        most, shown_n = max(counts), drawing.count_range(counts)
        kind = ngettext("n = {n_of} subject, held out", "n = {n_of} subjects, held out", most, n_of=shown_n)
        if not each.held_out:
            kind = ngettext(
                "n = {n_of} subject, in-sample", "n = {n_of} subjects, in-sample", most, n_of=shown_n
            )
        decimals = QUANTITIES[each.metric].decimals
        drawn = partial(_draw_models, rows=rows, axis=axis, scale=scale, decimals=decimals)
        draw = partial(drawn, of_all=len(results.subjects))
        lines = 1 + max(row.name.count("\n") for row in rows)
        height_mm = max(_MODEL_ROW_MM, drawing.LINE_MM * (lines + 0.5))
        panels[each.metric] = Panel(kind, title, height_mm * (len(rows) + 1), FOOT_MM, draw)
    return panels


def _draw_models(axes: Axes, rows: Sequence[PanelRow], scale: Scale, **more: Any) -> None:
    """Draw rows of dots with a line through the dots of each subject; more : arguments of draw_rows."""
    drawing.draw_rows(axes, rows, scale=scale, **more)
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    x = [[row.numbers.get(name, np.nan) for row in rows] + [np.nan] for name in names]
    y = [[*(aside + np.arange(len(rows))), np.nan] for aside in drawing.scatter_steps(len(names))]
    axes.plot(np.maximum(np.ravel(x), scale.low), np.ravel(y), color=RULE, linewidth=0.5, zorder=1.5)


def models(results: StudyResults) -> tuple[Figure, str]:
    """Draw the models' panels side by side. Raises NoDataError if no model has a score."""
    panels = [*model_panels(results).values()]
    if not panels:
        raise NoDataError(tr("no model of this study has a score; see skeleton_scores and problems"))
    headings = [
        (f"({name}) " if name else "") + f"{panel.title.rstrip('.')}, {panel.heading}."
        for name, panel in zip(drawing.panel_names(len(panels)), panels, strict=True)
    ]
    return drawing.print_figure(drawing.in_rows(panels, 2)), tr(
        "Comparison of skeleton models. {study_text} Each dot is a subject (mean over hands, recordings and "
        "digits), and lines join the dots of one subject; mark: mean; bar: 95 % confidence interval of the "
        "mean, for {n} or more subjects. The tip error of the replay shows how well the two sides of each "
        "joint agree, not where the joint is. {headings}",
        study_text=drawing.study_text(results),
        n=FEWEST_SUBJECTS,
        headings=" ".join(headings),
    )


def joints_in_order(results: StudyResults, joints: Collection[str]) -> list[str]:
    """Return joints ordered by digit, then those that belong to no digit, then those in no layout."""
    layouts = results.layouts.values()
    of_digits = [joint for layout in layouts for digit in layout.digits.values() for joint in digit.joints]
    others = [joint for layout in layouts for joint in layout.joints]
    return [joint for joint in dict.fromkeys([*of_digits, *others, *sorted(joints)]) if joint in joints]


_ACROSS, _CURVES_ACROSS = 3, 4
_SKELETON = ("subject", "session", "hand", "model", "calibrated_on")


@dataclass
class _ModelErrors:
    """True and stated errors of a model, by joint and then by hand."""

    error_mm: dict[str, dict[Hand, float]] = field(default_factory=lambda: defaultdict(dict))
    sd_mm: dict[str, dict[Hand, float]] = field(default_factory=lambda: defaultdict(dict))


def joint_errors(results: StudyResults) -> tuple[Figure, str]:
    """Draw joint errors, a panel per model; models with equal joints share one.

    Raises NoDataError if the truth is unknown.
    """
    judged = next((each for each in judged_models.judged_models(results) if each.metric == TRUTH), None)
    if judged is None:
        raise NoDataError(tr("the true joints are not known, or no model has a joint that could be compared"))
    errors = _errors_of_models(results, judged)
    of_hands = [of_hand for each in errors.values() for of_hand in each.error_mm.values()]
    scale = drawing.value_scale([error for of_hand in of_hands for error in of_hand.values()])
    prior = errors.pop(PRIOR, _ModelErrors())
    joints = joints_in_order(results, {joint for each in errors.values() for joint in each.error_mm})
    looks = palette.looks(list(results.models), palette.MODELS)
    panels = []
    for names in alike({model: errors[model] for model in results.models if model in errors}):
        of_model = errors[names[0]]
        counts = [len(of_joint) for of_joint in of_model.error_mm.values()]
        own, n_of = listed(names), drawing.count_range(counts)
        words = ngettext("{own}; n = {n_of} hand", "{own}; n = {n_of} hands", max(counts), own=own, n_of=n_of)
        draw = partial(
            _draw_errors, joints=joints, look=looks[names[0]], errors=of_model, prior=prior, scale=scale
        )
        panels.append(Panel(words, words, ROW_MM * len(joints), FOOT_MM, draw))
    handles = [
        Line2D([], [], color=colour, marker=marker, ls=cast(Any, style), alpha=alpha, label=words)
        for colour, marker, style, alpha, words in (
            (SOFT, "o", "none", 0.6, tr("hand")),
            (SOFT, "o", "-", 1.0, tr("median, quartiles")),
            (INK, "|", "none", 1.0, tr("stated 1-sigma error, median")),
            (SOFT, "|", "none", 1.0, tr("{PRIOR}, median", PRIOR=PRIOR)),
        )
    ]
    return drawing.print_figure(drawing.in_rows(panels, _ACROSS), handles), tr(
        "Error of each joint centre under each model. {study_text} Distance to the true centre in the frame "
        "of the distal (child) receiver [mm]. Each dot is a hand; mark: median; bar: quartiles, for "
        "{FEWEST_FOR_QUARTILES} or more hands; black line: median stated 1-sigma error in three dimensions "
        "(off the scale if larger than all errors); dotted line: median error of prior-only, the hand "
        "expected from anatomy. Models with equal joints share a panel. {kind}.",
        study_text=drawing.study_text(results),
        FEWEST_FOR_QUARTILES=drawing.FEWEST_FOR_QUARTILES,
        kind=tr("Held out") if judged.held_out else tr("In-sample"),
    )


def _errors_of_models(results: StudyResults, judged: JudgedModels) -> dict[str, _ModelErrors]:
    """Return each model's errors of a hand's joint, means over the held-out skeletons or over the others.

    judged : the metric, which states whether held-out skeletons are used.
    """
    scored = {
        key_of(row, _SKELETON) for row in results.rows.skeleton_scores if row["held_out"] == judged.held_out
    }
    values: dict[tuple[str, str, str, Hand], list[float]] = defaultdict(list)
    for row in results.counted(results.rows.joint_errors):
        if row["model"] in judged.references or key_of(row, _SKELETON) in scored:
            for kind, mm in (("error_mm", row["error_mm"]), ("sd_mm", row["sd_mm"])):
                if mm is not None:
                    values[kind, row["model"], row["joint"], hand_of(row)].append(mm)
    errors: dict[str, _ModelErrors] = defaultdict(_ModelErrors)
    for (kind, model, joint, hand), numbers in values.items():
        getattr(errors[model], kind)[joint][hand] = float(np.mean(numbers))
    return errors


def _draw_errors(
    axes: Axes, joints: Sequence[str], look: Look, errors: _ModelErrors, prior: _ModelErrors, scale: Scale
) -> None:
    """Draw each joint's errors by hand, with marks at the medians of stated errors and of anatomy alone."""
    rows = []
    for joint in joints:
        of_hand = errors.error_mm.get(joint, {})
        numbers = {f"{hand.who.token} {hand.hand}": error for hand, error in of_hand.items()}
        rows.append(PanelRow(joint, look, numbers))
    drawing.draw_rows(axes, rows, tr("Joint error [mm]"), scale)
    for of_joint, colour, style in ((errors.sd_mm, INK, "solid"), (prior.error_mm, SOFT, "dotted")):
        for y, joint in enumerate(joints):
            if of_joint.get(joint):
                level = np.median(list(of_joint[joint].values()))
                axes.vlines(level, y - 0.4, y + 0.4, color=colour, linestyle=style, linewidth=0.8)


_ABSENT = N_("no result")
_FILLS = {BELIEVED: ("0.45", ""), CARE: (AMBER, "////"), NOT: (NO, "xxxx"), _ABSENT: ("white", "")}
"""Fill colour and hatching of each verdict."""


def joint_trust(results: StudyResults) -> tuple[Figure, str]:
    """Draw verdicts on joints, a panel per model; models with equal verdicts share one.

    Raises NoDataError if there is no joint.
    """
    beliefs: dict[str, dict[str, dict[Hand, str]]] = {model: {} for model in results.models}
    for (hand, model), rows in results.joints_of.items():
        for row in rows if model in beliefs else []:
            of_joint = beliefs[model].setdefault(row["joint"], {})
            if (shown := belief(row)) != UNWORN:
                of_joint[hand] = shown
    beliefs = {model: of_model for model, of_model in beliefs.items() if of_model}
    if not beliefs:
        raise NoDataError(tr("no joint was solved in any hand of this study"))
    joints = joints_in_order(results, {joint for of_model in beliefs.values() for joint in of_model})
    panels = []
    for names in alike(beliefs):
        words = ngettext(
            "{models}; n = {n} hand", "{models}; n = {n} hands", len(results.hands), models=listed(names)
        )
        draw = partial(_draw_trust, joints=joints, beliefs=beliefs[names[0]], hands=results.hands)
        panels.append(Panel(words, words, ROW_MM * len(joints), FOOT_MM, draw))
    handles = [
        Patch(label=tr(kind).lstrip("✓◆✕ \u00a0"), facecolor=fill, hatch=hatch, edgecolor=INK, linewidth=0.4)
        for kind, (fill, hatch) in _FILLS.items()
    ]
    return drawing.print_figure(drawing.in_rows(panels, _ACROSS), handles), tr(
        "Which joints can be believed: percentage of the study's hands in which a joint can be believed (the "
        "error of its centre is at most {wanted} mm, 1 sigma in three dimensions, and nothing contradicts "
        "it), needs care (at most {care} mm, or there is a reason for doubt), cannot be believed (larger "
        "error, contradicted, suspect, or failed), or has no result or no receiver. {study_text} Skeletons "
        "were made from all calibration recordings. Models with equal results share a panel. A joint that a "
        "model does not have has no bar.",
        wanted=wanted_text(results.layouts.values()),
        care=wanted_text(results.layouts.values(), CARE_TIMES),
        study_text=drawing.study_text(results),
    )


def _draw_trust(
    axes: Axes, joints: Sequence[str], beliefs: Mapping[str, Mapping[Hand, str]], hands: Sequence[Hand]
) -> None:
    """Draw the shares of hands with each verdict on each joint; joints that the model lacks have no bar."""
    drawing.row_axes(axes, [word(joint) for joint in joints], tr("Hands [%]"), Scale(0.0, 100.0))
    rows = [(y, beliefs[joint]) for y, joint in enumerate(joints) if joint in beliefs]
    foot = np.zeros(len(rows))
    for kind, (fill, hatch) in _FILLS.items():
        shares = [100.0 * sum(of.get(hand, _ABSENT) == kind for hand in hands) / len(hands) for _, of in rows]
        y = [y for y, _ in rows]
        axes.barh(y, shares, 0.8, foot, facecolor=fill, hatch=hatch, edgecolor=INK, linewidth=0.4)
        foot += shares


def range_panels(movement: StudyMovement) -> dict[str, list[Panel]]:
    """Return panels by task: one for each of ANGLES that any joint has, with joints in digits' colours."""
    means = movement.subject_means.set_index(["task", *OF_ANGLE, "subject"])[RANGE].sort_index()
    titles = {task: task_title(task, calibrates=only) for task, only in movement.tasks.items()}
    of_tasks = {titles[task]: _range_panels(movement, means.loc[task], titles[task]) for task in titles
                if task in means.index}  # fmt: skip
    return {words: panels for words, panels in of_tasks.items() if panels}


def _range_panels(movement: StudyMovement, means: pd.Series[float], task: str) -> list[Panel]:
    """Return the panels of one task; means : by joint, angle and subject."""
    joints = list(dict.fromkeys(movement.ranges["joint"]))
    digits = list(dict.fromkeys(joint.partition("_")[0] for joint in joints if "_" in joint))
    colours = {digit: look.colour for digit, look in palette.looks(digits, palette.DIGITS).items()}
    looks = {joint: Look(colours.get(joint.partition("_")[0], INK), "o") for joint in joints}
    panels = []
    for angle in recording_results.ANGLES:
        there = [joint for joint in joints if (joint, angle) in means.index]
        rows = [PanelRow(joint, looks[joint], means[joint, angle].to_dict()) for joint in there]
        if not rows:
            continue
        axis = tr("{angle} [deg]", angle=capital(word(angle)))
        scale = drawing.value_scale([value for row in rows for value in row.values()])
        of_all = movement.ranges["subject"].nunique()
        draw = partial(drawing.draw_rows, rows=rows, axis=axis, scale=scale, of_all=of_all)
        title = tr("Range of motion by joint in {task}, {angle}.", task=task, angle=angle)
        panels.append(Panel(task, title, ROW_MM * (len(rows) + 1), FOOT_MM, draw))
    return panels


def ranges_of_motion(results: StudyResults, movement: StudyMovement) -> tuple[Figure, str]:
    """Draw ranges of motion, a row per joint angle and a dot per subject.

    Raises NoDataError if there are no joint angles.
    """
    if movement.ranges.empty:
        if movement.measured:
            raise NoDataError(
                tr("all hands with joint angles have suspect findings and are left out of all statistics")
            )
        raise NoDataError(tr("no recording of this study has joint angles"))
    return drawing.print_figure(list(range_panels(movement).values())), tr(
        "Range of motion (2.5th to 97.5th percentile) of each joint angle [deg], task by task. {study_text} "
        "Model {model}. Each dot is a subject (mean over trials, sessions and hands); mark: median; bar: "
        "quartiles. Hands with a suspect finding are left out.",
        study_text=drawing.study_text(results),
        model=movement.model,
    )


_STYLES = ("-", "--", ":", "-.")


def group_looks(levels: Iterable[str]) -> dict[str, CurveLook]:
    """Return the look of each level of a factor, or a common look if the only level is an empty string."""
    if (names := list(levels)) == [""]:
        return {"": CurveLook(tr("all subjects"), INK)}
    colours, styled = palette.level_looks(names), zip(names, cycle(_STYLES), strict=False)
    return {name: CurveLook(word(name), colours[name].colour, style) for name, style in styled}


def study_panels(movement: StudyMovement, groups: Mapping[str, str]) -> dict[str, list[Panel]]:
    """Return panels of flexion by task and event: one for each joint, with a line for each group."""
    looks, of_tasks = group_looks(dict.fromkeys(groups.values())), {}
    for (task, event), joints in movement.level_curves(groups).items():
        words = tr("{task}, cycles from “{event}”", task=task, event=event)
        of_tasks[words] = list(curve_panels(words, joints, looks).values())
    return of_tasks


def study_cycles(
    results: StudyResults, movement: StudyMovement, groups: Mapping[str, str]
) -> tuple[Figure, str]:
    """Draw flexion over the cycle, a panel for each joint, task by task.

    groups : each subject's level of the displayed factor. Raises NoDataError if no recording has cycles.
    """
    of_tasks = study_panels(movement, groups)
    if not of_tasks:
        raise NoDataError(tr(NO_CYCLES))
    rows: list[Sequence[Panel]] = [
        row for panels in of_tasks.values() for row in drawing.in_rows(panels, _CURVES_ACROSS)
    ]
    looks = group_looks(dict.fromkeys(groups.values()))
    return drawing.print_figure(rows, legend_handles(looks.values())), tr(
        "Flexion over the cycle, task by task ({tasks}): mean over subjects of each subject’s mean cycle "
        "[deg], at each percent of the cycle; n: number of subjects of each line, in the legend’s order. "
        "Shaded: ± one standard deviation over subjects. {study_text} Model {model}. Hands with a suspect "
        "finding are left out.",
        tasks="; ".join(of_tasks),
        study_text=drawing.study_text(results),
        model=movement.model,
    )


NO_CYCLES = N_(
    "no angles are averaged over cycles, because no recording has usable cycles; cycles start at events, "
    "which the study’s events sheet lists"
)


def group_panels(factors: Sequence[ComparedFactor], n_subjects: int) -> list[Panel]:
    """Return a panel for each displayed quantity of the factors: a row per level, a dot per subject."""
    panels = []
    for drawn in (each for factor in factors for each in factor.drawn):
        looks = palette.level_looks(drawn.levels)
        rows = [
            PanelRow(level, looks[level], numbers, float(np.mean([*numbers.values()])))
            for level, numbers in drawn.levels.items()
            if numbers
        ]
        values = [value for row in rows for value in row.values()]
        scale = Scale(min(values) - 1.0, max(values) + 1.0)
        if min(values) >= 0:
            scale = drawing.value_scale(values)
        draw_in = _draw_models if drawn.paired else drawing.draw_rows
        draw = partial(draw_in, rows=rows, axis=drawn.axis, scale=scale, of_all=n_subjects)
        panels.append(Panel(drawn.title, drawn.title, _MODEL_ROW_MM * (len(rows) + 1), FOOT_MM, draw))
    return panels


def groups(results: StudyResults, study: Study, movement: StudyMovement) -> tuple[Figure, str]:
    """Draw the groups' panels side by side. Raises NoDataError if no two levels have values."""
    factors = movement_results.compared_factors(results, study, movement)
    panels = group_panels(factors, len(results.subjects))
    if not panels:
        reasons = [f"{factor.name}: {factor.reason}" for factor in factors]
        raise NoDataError("; ".join(reasons) or tr("the study file names no factors"))
    return drawing.print_figure(drawing.in_rows(panels, 2)), tr(
        "Levels of the study's factors compared: the quantities that the study file lists, and those that "
        "differ most. {study_text} Model {model}. Each dot is a subject (mean over trials and sessions); a "
        "line joins the dots of a subject with both levels; mark: mean. Tests: table movement_differences.",
        study_text=drawing.study_text(results),
        model=movement.model,
    )


def lengths_panel(results: StudyResults, who: SubjectSession, model: str) -> Panel | None:
    """Return the panel of a subject's bone lengths under a model for its page, or None if there are none."""
    lengths = {
        hand: {(row["bone"], row["digit"]): row for row in rows if row["length_mm"] is not None}
        for hand in results.hands_of(*who)
        if (rows := results.bones_of.get((hand, model)))
    }
    bones = list(dict.fromkeys(bone for of_hand in lengths.values() for bone in of_hand))
    if not bones:
        return None
    title = tr("Bone lengths of {who}, {model}.", who=who.label, model=model)
    draw = partial(_draw_lengths, bones=bones, lengths=lengths)
    return Panel("", title, ROW_MM * len(bones), FOOT_MM, draw)


def _draw_lengths(
    axes: Axes,
    bones: Sequence[tuple[str, str]],
    lengths: Mapping[Hand, Mapping[tuple[str, str], BoneLengthsRow]],
) -> None:
    """Draw every bone's length with its 1-sigma error; markers are filled for right and open for left."""
    names = [name for name, _ in bones]
    words = [word(name) + (f" ({word(digit)})" if names.count(name) > 1 else "") for name, digit in bones]
    most = max(row["length_mm"] + (row["sd_mm"] or 0.0) for of in lengths.values() for row in of.values())
    drawing.row_axes(axes, words, tr("Bone length, 1-sigma error [mm]"), Scale(0.0, 1.05 * most))
    for hand, of_hand in lengths.items():
        left = hand.hand == "left"
        aside = 0.0 if len(lengths) == 1 else 0.18 if left else -0.18
        for y, bone in enumerate(bones):
            if bone in of_hand:
                axes.errorbar(
                    of_hand[bone]["length_mm"], y + aside, xerr=of_hand[bone]["sd_mm"], fmt="o", color=INK,
                    elinewidth=0.8, markersize=3.4, markerfacecolor=PAPER if left else INK,
                    markeredgewidth=0.7, clip_on=False,
                )  # fmt: skip
