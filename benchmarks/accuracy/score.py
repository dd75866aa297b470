"""Measure how far an estimate of a hand is from the truth: centres, axes, bones, palm, and its stated errors.

Errors of many hands are summed up by the metrics of a row of the tables.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.accuracy.trials import Trial
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.verdict import RADIUS_SD
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.evaluate_skeletons.truth_errors import line_angle_deg
from shukotsu.stages.simulate.random_hand import BONES, DIGITS, FINGERS
from shukotsu.stages.simulate.simulated_truth import TrueJoint
from shukotsu.stages.simulate.simulation import LAYOUT

COVERED_95 = 7.815
"""95 % of squared Mahalanobis distances in three dimensions are below this."""

COVERED_95_SD = 1.96
"""The same in one dimension, of a length, in sds."""

GROSS_MM = 5.0

JOINT_TYPES = {
    "thumb CMC": ("thumb_cmc",),
    "thumb MCP": ("thumb_mcp",),
    "thumb IP": ("thumb_ip",),
    "MCP 2-3": ("index_mcp", "middle_mcp"),
    "MCP 4-5": ("ring_mcp", "little_mcp"),
    **{kind.upper(): tuple(f"{digit}_{kind}" for digit in FINGERS) for kind in ("pip", "dip")},
}
"""Joints that are alike, by their short name."""

PHALANGES = tuple(f"{digit}_proximal" for digit in DIGITS) + tuple(f"{digit}_middle" for digit in FINGERS)
"""Bones between two joints that are solved. The last bone of a digit ends where no receiver sees it end."""


@dataclass(frozen=True)
class Centre:
    """One joint as an estimator has it, in the parent's and the child's receiver frame, mm.

    covariance_mm2 : (6, 6) of both halves, or None where none is stated. axis_child : (3,), of either sign,
    or None where none is estimated. parent_mm, child_mm : NaN where only the axis is.
    """

    parent_mm: Array
    child_mm: Array
    covariance_mm2: Array | None = None
    axis_child: Array | None = None


@dataclass(frozen=True)
class Estimate:
    """A hand as an estimator has it. lengths_mm : of its bones, of PHALANGES at least; length_sd_mm : as far
    as it states them. palm_deg : mean angle between the fitted and the true direction of the ring's and the
    little finger's metacarpals. seconds : of one processor.
    """

    centres: Mapping[str, Centre]
    seconds: float
    lengths_mm: Mapping[str, float] = field(default_factory=dict)
    length_sd_mm: Mapping[str, float] = field(default_factory=dict)
    palm_deg: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class JointError:
    """One joint against the truth; NaN for what was not estimated, None for what was not stated.

    child_mm : of the half in the child's receiver frame, where the truth is one point; along_mm, across_mm
    its parts along the true axis and perpendicular to it. in_radius : whether the worse half is within the
    95 % radius of the stated sd. in_ellipsoid : share of the two halves in their 95 % ellipsoids.
    """

    joint: str
    child_mm: float
    along_mm: float
    across_mm: float
    axis_deg: float
    in_radius: float | None
    in_ellipsoid: float | None


@dataclass(frozen=True)
class BoneError:
    """The length of one bone: its error in percent of the true one, and whether its 95 % hold that."""

    bone: str
    percent: float
    inside: float | None

    @property
    def kind(self) -> str:
        """Metacarpal, proximal, middle or distal."""
        return self.bone.split("_")[1]


@dataclass(frozen=True)
class HandScore:
    """All errors of one estimator on one hand."""

    estimator: str
    joints: tuple[JointError, ...]
    bones: tuple[BoneError, ...]
    palm_deg: tuple[float, ...]
    seconds: float


def score(estimator: str, trial: Trial, estimate: Estimate) -> HandScore:
    """Hold an estimate against the trial's truth."""
    joints = read_layout(LAYOUT).joints
    return HandScore(
        estimator,
        tuple(
            joint_error(trial.truth.joints[name], centre, hinge=joints[name].dof == 1)
            for name, centre in estimate.centres.items()
        ),
        tuple(_bone_error(trial, bone, estimate) for bone in estimate.lengths_mm),
        tuple(estimate.palm_deg.values()),
        estimate.seconds,
    )


def _bone_error(trial: Trial, bone: str, estimate: Estimate) -> BoneError:
    true_mm = float(trial.truth.hand.length_mm[BONES.index(bone)])
    off_mm, sd_mm = estimate.lengths_mm[bone] - true_mm, estimate.length_sd_mm.get(bone)
    inside = None if sd_mm is None else float(abs(off_mm) <= COVERED_95_SD * sd_mm)
    return BoneError(bone, 100 * off_mm / true_mm, inside)


def joint_error(true: TrueJoint, centre: Centre, *, hinge: bool) -> JointError:
    """Hold one joint against the truth; only a hinge has one axis to be held against."""
    parent, child = centre.parent_mm - true.parent_mm, centre.child_mm - true.child_mm
    along = float(child @ true.axis_child)
    axis_deg = float("nan")
    if hinge and centre.axis_child is not None:
        axis_deg = line_angle_deg(centre.axis_child, true.axis_child)
    in_radius = in_ellipsoid = None
    if centre.covariance_mm2 is not None:
        in_radius, in_ellipsoid = coverage(parent, child, centre.covariance_mm2)
    return JointError(
        true.name,
        float(np.linalg.norm(child)),
        abs(along),
        float(np.linalg.norm(child - along * true.axis_child)),
        axis_deg,
        in_radius,
        in_ellipsoid,
    )


def coverage(parent_mm: Array, child_mm: Array, covariance_mm2: Array) -> tuple[float, float | None]:
    """Whether the worse of two errors (3,) is within the 95 % radius; the share in their 95 % ellipsoids.

    covariance_mm2 : (6, 6) of both. A flat ellipsoid, as of a centre put on a plane, holds nothing: None.
    """
    halves = ((parent_mm, covariance_mm2[:3, :3]), (child_mm, covariance_mm2[3:, 3:]))
    sd = np.sqrt(max(float(np.trace(covariance)) for _, covariance in halves))
    worse = max(float(np.linalg.norm(error)) for error, _ in halves)
    inside = []
    for error, covariance in halves:
        if np.linalg.eigvalsh(covariance)[0] < 1e-9:
            return float(worse <= RADIUS_SD * sd), None
        inside.append(error @ np.linalg.solve(covariance, error) < COVERED_95)
    return float(worse <= RADIUS_SD * sd), float(np.mean(inside))


def phalanges_mm(centres: Mapping[str, Centre]) -> dict[str, float]:
    """Lengths of the phalanges from joint to joint, each in its own receiver's frame."""
    joints = read_layout(LAYOUT).joints
    own = {joints[name].child: centre.child_mm for name, centre in centres.items()}
    after = {joints[name].parent: centre.parent_mm for name, centre in centres.items()}
    return {bone: float(np.linalg.norm(after[bone] - own[bone])) for bone in PHALANGES}


@dataclass(frozen=True)
class Metric:
    """A number of a summary: its column's head and format, the statistic, and what a hand adds to it.

    values : of one hand; None and NaN are what was not stated or estimated, and do not count.
    """

    head: str
    form: str
    statistic: Callable[[Array], Any]
    values: Callable[[HandScore], Iterable[float | None]]


def _of_joints(name: str) -> Callable[[HandScore], Iterable[float | None]]:
    return lambda hand: (getattr(joint, name) for joint in hand.joints)


def _of_phalanges(hand: HandScore) -> Iterable[float]:
    """Errors without sign of those bones that every estimator of centres has a length of."""
    return (abs(one.percent) for one in hand.bones if one.bone in PHALANGES)


def _percent(shares: npt.ArrayLike) -> float:
    return 100.0 * float(np.mean(np.asarray(shares)))


METRICS = {
    "n_hands": Metric("hands", "d", len, lambda _: [1.0]),
    "median_mm": Metric("median mm", ".2f", np.median, _of_joints("child_mm")),
    "p90_mm": Metric("p90 mm", ".2f", lambda mm: np.percentile(mm, 90), _of_joints("child_mm")),
    "along_mm": Metric("along mm", ".2f", np.median, _of_joints("along_mm")),
    "across_mm": Metric("across mm", ".2f", np.median, _of_joints("across_mm")),
    "gross_percent": Metric("> 5 mm %", ".1f", lambda mm: _percent(mm > GROSS_MM), _of_joints("child_mm")),
    "axis_deg": Metric("axis deg", ".1f", np.median, _of_joints("axis_deg")),
    "bone_percent": Metric("bones %", ".1f", np.median, _of_phalanges),
    "length_percent": Metric(
        "length in 95 %", ".1f", _percent, lambda hand: (one.inside for one in hand.bones)
    ),
    "palm_deg": Metric("palm deg", ".1f", np.mean, lambda hand: hand.palm_deg),
    "radius_percent": Metric("in radius %", ".1f", _percent, _of_joints("in_radius")),
    "ellipsoid_percent": Metric("in ellipsoid %", ".1f", _percent, _of_joints("in_ellipsoid")),
    "seconds": Metric("CPU s", ".2f", np.mean, lambda hand: [hand.seconds]),
}
"""Over all counted joints, hinges, phalanges, ulnar metacarpals or hands of one estimator, by name."""

Summary = Mapping[str, Any]
"""By the name of a metric; None where nothing was estimated or stated."""


def summary(hands: Sequence[HandScore]) -> Summary:
    """Sum up the scores of one estimator."""
    numbers: dict[str, int | float | None] = {}
    for name, metric in METRICS.items():
        known = [value for hand in hands for value in metric.values(hand) if value is not None]
        values = np.array(known, float)[np.isfinite(known)] if known else np.empty(0)
        number = metric.statistic(values) if len(values) else None
        numbers[name] = number if number is None or isinstance(number, int) else float(number)
    return numbers
