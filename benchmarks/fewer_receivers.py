"""Simulated hands with fewer receivers: tasks after a calibration with all, and calibrations with few."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.accuracy import add_people
from benchmarks.benchmark_table import TextTable
from shukotsu.schemas.layout import Layout, read_layout
from shukotsu.schemas.poses import Poses
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.skeleton.joint_angles import angles_of_hand
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.angle_bones import angle_bones
from shukotsu.stages.fit_hand.compiled_equations import pose, reduce
from shukotsu.stages.fit_hand.fingertips import Fingertips, fingertips
from shukotsu.stages.fit_hand.fit import HandFit, fit_hand
from shukotsu.stages.fit_hand.fitted_motion import PosedHand, pose_hand
from shukotsu.stages.fit_hand.frame_uncertainty import posed_errors
from shukotsu.stages.fit_hand.gauss_newton import first_guess
from shukotsu.stages.fit_hand.posterior import Posterior
from shukotsu.stages.simulate.random_hand import BONES, FINGERS
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import LAYOUT, Simulated, simulate

HANDS = ("right", "left")
SUBJECT, CALIBRATION, TASK = "01", "rom", "opposition"
EVERY = 12
"""Frames of the task are taken at 20 Hz: a motion repeats itself."""

FEWER: Mapping[int, Sequence[str]] = {
    11: ("hand", "thumb_metacarpal", *(f"{digit}_proximal" for digit in FINGERS)),
    7: ("hand", "thumb_metacarpal"),
    6: ("hand",),
}
"""Receivers worn beside those on the fingertips: without middle phalanges; `two-hands-7`; `tips-and-hand`."""

CENTRES, PIP, DIP = "centres mm", "PIP deg", "DIP deg"


@dataclass(frozen=True)
class Errors:
    """Errors of one hand's task, and the sd stated of each: centres in 3-D, mm; PIP and DIP flexion, deg."""

    calibrated: int
    worn: int
    error: Mapping[str, Array]
    sd: Mapping[str, Array]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    add_people(parser)


def worn_of(layout: Layout) -> Mapping[int, Sequence[str]]:
    """Segments that wear a receiver, by how many they are."""
    tips = [digit.tip for digit in layout.digits.values()]
    return {len(layout.expected): layout.expected} | {n: (*own, *tips) for n, own in FEWER.items()}


def only(poses: Poses, worn: Sequence[str]) -> Poses:
    """The recording with the poses of some receivers alone."""
    kept = np.isin(np.array(poses.segments), np.array(worn))
    return replace(poses, valid=poses.valid & kept)


def hand_errors(seed: int, side: str, n_frames: int | None = None) -> Iterator[tuple[str, Errors]]:
    """Errors on one hand: as fitted, and with the true hand in place of the fitted one (the bound)."""
    layout, hand = read_layout(LAYOUT), (SUBJECT, side)
    calibration, task = (
        simulate(*hand, name, seed, Realism.full(), n_frames) for name in (CALIBRATION, TASK)
    )
    clean = replace(Realism.full(), artefact=0.0, field_distortion=0.0, noise=0.0)
    true = fit_hand([simulate(*hand, CALIBRATION, seed, clean, n_frames).poses()], layout, side)
    sets = worn_of(layout)
    everything = max(sets)
    tips = fingertips(fit_hand([calibration.poses()], layout, side))
    for worn, segments in sets.items():
        yield "fitted", task_errors(tips, task, segments, everything, worn)
        if worn == everything:
            continue
        few = fingertips(fit_hand([only(calibration.poses(), segments)], layout, side))
        yield "fitted", task_errors(few, task, segments, worn, worn)
        yield "bound", task_errors(fingertips(at_truth(few.fit, true)), task, segments, worn, worn)


def at_truth(fit: HandFit, true: HandFit) -> HandFit:
    """The fit with the unknowns of the true hand, and the covariance that its own frames give there.

    true : fitted to the same hand's receivers without skin, field and noise.
    """
    evidence, known = fit.evidence, true.evidence.posterior.x
    place = {name: index for index, name in enumerate(true.evidence.model.unknowns.names)}
    x = np.array([known[place[name]] if name in place else 0.0 for name in evidence.model.unknowns.names])
    point = pose(evidence.problem, first_guess(evidence.problem, evidence.model, x))
    reduced = reduce(evidence.problem, point).frames_first()
    posterior = Posterior.of(evidence.problem, point, reduced, evidence.share)
    return replace(fit, evidence=replace(evidence, posterior=posterior, states=point.y))


def task_errors(
    tips: Fingertips, task: Simulated, worn: Sequence[str], calibrated: int, n_worn: int
) -> Errors:
    """Pose a task with some receivers and compare it with its truth."""
    fit, rows = tips.fit, np.arange(0, len(task.frame), EVERY)
    poses = only(task.poses().take(rows), worn)
    posed = pose_hand(fit, poses)
    stated = posed_errors(tips, posed, fit.evidence.convention.frames(poses))
    places = [BONES.index(name) for name in posed.bones]
    true = replace(posed, bone_quaternion=task.truth.bone_quaternion[rows][:, places])
    angles, true_angles = (_angles_deg(fit, own, task.hand) for own in (posed, true))
    off_mm = posed.bone_position_mm - task.truth.bone_position_mm[rows][:, places]
    error = {CENTRES: np.linalg.norm(off_mm, axis=-1)[:, 1:].ravel()}
    sd = {CENTRES: stated.centre_mm[:, 1:].ravel()}
    for name, kind in ((PIP, "pip"), (DIP, "dip")):
        joints = [f"{digit}_{kind}" for digit in FINGERS]
        error[name] = np.concatenate([np.abs(angles[j][:, 0] - true_angles[j][:, 0]) for j in joints])
        sd[name] = np.concatenate([stated.angles_deg[j][:, 0] for j in joints])
    return Errors(calibrated, n_worn, error, sd)


def _angles_deg(fit: HandFit, posed: PosedHand, side: str) -> dict[str, Array]:
    bones, rests = angle_bones(fit, posed)
    return angles_of_hand(posed.bones, bones, bones[:, 0], fit.evidence.layout, side, rests)


def run(seeds: Sequence[int]) -> Iterator[TextTable]:
    """Give the tables over both hands of the people of those seeds."""
    pairs = [pair for seed in seeds for side in HANDS for pair in hand_errors(seed, side)]
    hands = f"{2 * len(seeds)} simulated hands (seeds {min(seeds)} to {max(seeds)}, right and left)"
    for name in (CENTRES, PIP, DIP):
        yield table(name, pairs, hands)


def table(name: str, pairs: Sequence[tuple[str, Errors]], hands: str) -> TextTable:
    """Errors of one kind by receivers."""
    groups: dict[tuple[int, int], dict[str, list[Errors]]] = {}
    for kind, one in pairs:
        groups.setdefault((one.calibrated, one.worn), {}).setdefault(kind, []).append(one)
    rows = [
        (calibrated, worn, *_numbers(own["fitted"], name), *_numbers(own.get("bound", []), name)[2:3])
        for (calibrated, worn), own in sorted(groups.items(), key=lambda item: (-item[0][0], -item[0][1]))
    ]
    columns = (
        "calibrated with:d", "task with:d", "median:.2f", "p90:.2f", "stated sd:.2f", "within 95 % %:.1f",
        "sd at the truth:.2f",
    )  # fmt: skip
    meaning = (
        f"{hands}; {CALIBRATION} calibrates, {TASK} is posed. Errors against the truth, frame by frame: of "
        "all joints' centres in the transmitter's frame, of the fingers' flexion. Stated sd: root mean "
        "square over frames. Sd at the truth: what the same receivers state of the true hand, linearised "
        "there. 11 receivers lack the middle phalanges and the thumb's proximal one."
    )
    return TextTable(name, columns, rows, meaning)


def _numbers(errors: Sequence[Errors], name: str) -> tuple[float | None, ...]:
    """Median and 90th percentile of the errors, stated sd (rms), and share within the stated 95 %."""
    if not errors:
        return (None,) * 4
    off, sd = (np.concatenate([getattr(one, part)[name] for one in errors]) for part in ("error", "sd"))
    within = (RADIUS_SD if name == CENTRES else 1.96) * sd
    return (
        float(np.median(off)),
        float(np.percentile(off, 90)),
        float(np.sqrt(np.mean(sd**2))),
        100 * float(np.mean(off <= within)),
    )
