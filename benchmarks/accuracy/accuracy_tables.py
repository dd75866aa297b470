"""The tables of the accuracy benchmark."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from benchmarks.accuracy import estimators
from benchmarks.accuracy.score import JOINT_TYPES, METRICS, HandScore, Summary, summary
from benchmarks.accuracy.tip_scores import CONTACTS, RECEIVER, SKIN, TOUCHED, TRUE, TipError
from benchmarks.accuracy.trials import FULL
from benchmarks.benchmark_table import Cell, TextTable
from shukotsu.anatomy.drawn_hands import BONE_KINDS
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.stages.simulate.random_hand import DIGITS

Scores = Mapping[str, Mapping[str, Sequence[HandScore]]]
"""By scenario and estimator."""

OF_ESTIMATOR = tuple(name for name in METRICS if name not in ("n_hands", "length_percent"))
OF_SCENARIO = ("n_hands", "median_mm", "p90_mm", "gross_percent", "radius_percent", "palm_deg")


def _columns(names: Iterable[str]) -> list[str]:
    return [f"{METRICS[name].head}:{METRICS[name].form}" for name in names]


def _cells(one: Summary, names: Iterable[str]) -> list[Cell]:
    return [one[name] for name in names]


def estimator_table(scenario: str, scores: Mapping[str, Sequence[HandScore]], people: str) -> TextTable:
    """Give all estimators in one scenario."""
    rows = [
        (name, *_cells(summary(scores[name]), OF_ESTIMATOR)) for name in estimators.OURS if name in scores
    ]
    return TextTable(
        f"accuracy: {scenario}, {people}",
        ("estimator", *_columns(OF_ESTIMATOR)),
        rows,
        "Distance of all 15 centres from the truth in the child's receiver frame; medians of its parts "
        "along and across the true axis; axis of the hinges and length of nine phalanges (medians); mean "
        "angle to the true direction of the ring's and the little finger's metacarpals; how often the "
        f"stated 95 % radius ({RADIUS_SD} sd) and ellipsoid hold the truth; processor time for a hand. "
        f"Measured: with {estimators.MEASURED_SD_MM} mm error.",
    )


def joint_table(scores: Mapping[str, Sequence[HandScore]], people: str) -> TextTable:
    """Median and p90 by type of joint."""
    names = (estimators.PRIOR, estimators.PAPER, estimators.WHOLE, estimators.MEASURED)
    shown = [name for name in names if name in scores]
    rows: list[tuple[Cell, ...]] = []
    for kind, members in JOINT_TYPES.items():
        numbers: list[Cell] = []
        for name in shown:
            off = [j.child_mm for hand in scores[name] for j in hand.joints if j.joint in members]
            numbers += [float(value) for value in np.percentile(off, [50, 90])]
        rows.append((kind, *numbers))
    heads = [f"{name}: {what}:.2f" for name in shown for what in ("median", "p90")]
    return TextTable(
        f"accuracy: {FULL.name} by type of joint, {people}",
        ("joints", *heads),
        rows,
        "Distance from the true centre in mm, as above.",
    )


def scenario_table(scores: Scores, shown: Sequence[str], people: str) -> TextTable:
    """Scenarios beside each other: a row for each and estimator."""
    rows = [
        (scenario, name, *_cells(summary(by_name[name]), OF_SCENARIO))
        for scenario, by_name in scores.items()
        for name in shown
    ]
    return TextTable(
        f"accuracy: scenarios side by side, {people}",
        ("scenario", "estimator", *_columns(OF_SCENARIO)),
        rows,
        "Distance of all 15 centres from the truth in the child's receiver frame. Blend is the usual "
        "recording: people drawn around a blend of published hands, each around another one; every other "
        "scenario differs from it in one thing. Ct, xray, other-anatomy: people around the CT hand, around "
        "the X-ray pictures' and around a table far from all sources. Stiff DIPs: opposition instead of "
        "range of motion. Polynomial, phase-lag: other laws of the skin. Faults: a tracker that loses poses, "
        "names the wrong hemisphere and jumps, read as any recording is.",
    )


def length_table(scores: Scores, shown: Sequence[str], people: str) -> TextTable:
    """Lengths of bones by scenario, estimator and kind of bone, with sign."""
    rows: list[tuple[Cell, ...]] = []
    for scenario, by_name in scores.items():
        for name in shown:
            bones = [bone for hand in by_name[name] for bone in hand.bones]
            means = [_mean([b.percent for b in bones if b.kind == kind]) for kind in BONE_KINDS]
            stated = summary(by_name[name])["length_percent"]
            rows.append((scenario, name, _mean([bone.percent for bone in bones]), *means, stated))
    return TextTable(
        f"accuracy: lengths of bones, {people}",
        ("scenario", "estimator", *(f"{kind} %:.1f" for kind in ("all", *BONE_KINDS)), "in 95 %:.1f"),
        rows,
        "Mean error of the lengths, with its sign, in percent of the true ones: of all bones that the "
        "estimator has lengths of, and by kind; how often the stated 95 % of a length hold the true one.",
    )


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def tip_table(tips: Sequence[TipError], people: str) -> TextTable:
    """Fingertips on the held-out task."""
    ends = [name + SKIN for name in (estimators.WHOLE, TOUCHED, CONTACTS)]
    rows: list[tuple[Cell, ...]] = []
    for name in (RECEIVER, *estimators.OURS, TOUCHED, CONTACTS, *ends, TRUE):
        if own := [tip for tip in tips if tip.skeleton == name]:
            mm = np.array([(tip.mean_mm, tip.constant_mm, tip.moving_mm) for tip in own])
            p90_mm = float(np.percentile(mm[:, 0], 90))
            digits = [float(np.mean([tip.mean_mm for tip in own if tip.digit == digit])) for digit in DIGITS]
            rows.append((name, *digits, mm[:, 0].mean(), p90_mm, *mm[:, 1:].mean(0)))
    heads = (*DIGITS, "all", "p90", "constant", "moving")
    return TextTable(
        f"accuracy: the end of the last bone in opposition, calibrated on range of motion, {people}",
        ("skeleton", *(f"{head} mm:.2f" for head in heads)),
        rows,
        "Mean over the frames of the second half of opposition of the distance to the true end of the last "
        "bone (or, where the row says so, of the digit, skin and all), mean over hands (p90 over digits "
        "and hands); its constant part as the bone sees it, and the rest (means). One touch: each digit's "
        "end on a known point once, to 0.4 mm per direction, in the calibration. Contacts: found by the "
        "estimator itself in the first half of opposition. The true point rides on the distal receiver "
        "too: what is left there is skin, field and noise.",
    )
