"""Simulated hands against their truth: how far joint centres and tips are off, and whether the sd says so."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from benchmarks.simulated_hand import (
    ESTIMATED,
    MODEL,
    TASKS,
    TRUE,
    HandErrors,
    JointError,
    TipError,
    hand_errors,
)
from benchmarks.text_table import Cell, TextTable

COMPOUND = "MCP 4-5"
JOINT_TYPES = {
    "thumb CMC": ("thumb_cmc",),
    "thumb MCP": ("thumb_mcp",),
    "thumb IP": ("thumb_ip",),
    "MCP 2-3": ("index_mcp", "middle_mcp"),
    COMPOUND: ("ring_mcp", "little_mcp"),
    "PIP": ("index_pip", "middle_pip", "ring_pip", "little_pip"),
    "DIP": ("index_dip", "middle_dip", "ring_dip", "little_dip"),
}
ALL = "all"
BINDINGS = ("first-frame", "least-squares")

RADIUS_SD = 1.614
"""95 % of a three-dimensional error lie within this many sd_mm, if it is as large in every direction."""

NO_CRIME = (
    "Simulator and estimator share no model of the skin: the paper's method has none, and the simulated skin "
    "saturates, lags and wanders."
)


def run(seeds: int = 20, n_frames: int | None = None, processes: int = 2) -> Iterator[TextTable]:
    """Give the tables over that many seeds, right and left hand of each."""
    hands = [(seed, hand) for seed in range(seeds) for hand in ("right", "left")]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        found: list[HandErrors] = list(
            pool.map(hand_errors, *zip(*hands, strict=True), [n_frames] * len(hands))
        )
    joints = [joint for hand in found for joint in hand.joints]
    whose = f"{len(hands)} simulated hands ({seeds} seeds, right and left), full realism, {MODEL}"
    for task in TASKS:
        yield centres([joint for joint in joints if joint.calibration == task], f"{task}, {whose}")
    yield statuses(joints, whose)
    yield tips([tip for hand in found for tip in hand.tips], whose)


def centres(joints: Sequence[JointError], whose: str) -> TextTable:
    """Errors of the joint centres by joint type."""
    groups = {
        name: [joint for joint in joints if joint.joint in members] for name, members in JOINT_TYPES.items()
    }
    rows = [_centre_row(name, group) for name, group in [*groups.items(), (ALL, joints)]]
    return TextTable(
        f"paper_accuracy: joint centres solved from {whose}",
        (
            ("joints", ""),
            ("n", "d"),
            ("failed", "d"),
            ("median mm", ".1f"),
            ("p90 mm", ".1f"),
            ("along axis mm", ".1f"),
            ("across axis mm", ".1f"),
            ("> 5 mm %", ".0f"),
            ("> 50 mm %", ".1f"),
            ("worse half mm", ".1f"),
            ("sd mm", ".1f"),
            ("within 95 % radius %", ".0f"),
        ),
        rows,
        "Distance to the true centre in the child's receiver frame, its parts along and across the true axis "
        "(medians), and shares of it; then the worse of both halves (median) beside the sd stated for it "
        f"(median), and how often it is within {RADIUS_SD} sd: 95 % if the sd held everything. {NO_CRIME}",
    )


def _centre_row(name: str, group: Sequence[JointError]) -> tuple[Cell, ...]:
    solved = [joint for joint in group if joint.status != "failed"]
    failed = len(group) - len(solved)
    if not solved:
        return (name, len(group), failed, *[None] * 9)
    child = _values(joint.child_mm for joint in solved)
    worse = _values(joint.worse_mm for joint in solved)
    sd = _values(joint.sd_mm for joint in solved)
    return (
        name,
        len(group),
        failed,
        float(np.median(child)),
        float(np.percentile(child, 90)),
        float(np.median(_values(joint.along_mm for joint in solved))),
        float(np.median(_values(joint.across_mm for joint in solved))),
        100 * float(np.mean(child > 5)),
        100 * float(np.mean(child > 50)),
        float(np.median(worse)),
        float(np.median(sd)),
        100 * float(np.mean(worse <= RADIUS_SD * sd)),
    )


def statuses(joints: Sequence[JointError], whose: str) -> TextTable:
    """Errors of the joint centres by the status that the pipeline gave them, compound joints apart."""
    rows: list[tuple[Cell, ...]] = []
    compound = JOINT_TYPES[COMPOUND]
    for task in TASKS:
        for name, apart in ((f"all but {COMPOUND}", False), (COMPOUND, True)):
            group = [j for j in joints if j.calibration == task and (j.joint in compound) == apart]
            for status in ("ok", "weak"):
                child = _values(joint.child_mm for joint in group if joint.status == status)
                numbers: list[Cell] = [None] * 4
                if len(child):
                    p50, p90 = np.percentile(child, [50, 90])
                    numbers = [float(p50), float(p90), 100 * float(np.mean(child > 5)), float(child.max())]
                rows.append((task, name, status, len(child), *numbers))
    return TextTable(
        f"paper_accuracy: what the status of a joint is worth, {whose}",
        (
            ("solved from", ""),
            ("joints", ""),
            ("status", ""),
            ("n", "d"),
            ("median mm", ".1f"),
            ("p90 mm", ".1f"),
            ("> 5 mm %", ".0f"),
            ("worst mm", ".1f"),
        ),
        rows,
        "Distance to the true centre in the child's receiver frame. ok says that the data fix the fit, not "
        f"that the joint is a hinge: {COMPOUND}, seen from the hand, have a palm that moves between, which "
        "residuals hardly show.",
    )


def tips(found: Iterable[TipError], whose: str) -> TextTable:
    """Tip errors of estimated and true skeletons, in the recording they were solved from and the other."""
    errors: dict[tuple[str, str, bool, str], list[float]] = {}
    for tip in found:
        key = tip.calibration, tip.skeleton, tip.held_out, tip.binding
        errors.setdefault(key, []).append(tip.mean_mm)
    rows: list[tuple[Cell, ...]] = []
    for task in TASKS:
        for held_out in (False, True):
            replayed = TASKS[1 - TASKS.index(task)] if held_out else task
            for skeleton in (ESTIMATED, TRUE):
                by_binding = [errors.get((task, skeleton, held_out, binding), []) for binding in BINDINGS]
                numbers = [float(f(part)) if part else None for part in by_binding for f in (np.median, _p90)]
                rows.append((task, replayed, "yes" if held_out else "no", skeleton, *numbers))
    heads = [(f"{binding} {what}", ".1f") for binding in BINDINGS for what in ("median mm", "p90 mm")]
    return TextTable(
        f"paper_accuracy: tip error, {whose}",
        (("solved from", ""), ("replayed in", ""), ("held out", ""), ("skeleton", ""), *heads),
        rows,
        "Mean distance over a recording of the replayed tip to the distal receiver, median and p90 over "
        "digits and hands; the true skeleton has the truth's centres and is replayed alike. The tip error is "
        "a sum of fit residuals: where the truth does no better than centres that are millimetres off, it "
        f"does not measure the skeleton. {NO_CRIME}",
    )


def _p90(values: Sequence[float]) -> float:
    return float(np.percentile(values, 90))


def _values(numbers: Iterable[float]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.fromiter(numbers, float)
