"""Hands of two simulators: errors of the fit, verdicts, and calibration of the stated sd."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks import faultless_hands
from benchmarks.benchmark_table import PrintedTable, of_each_person, percent
from benchmarks.other_hands.recording import true_centres
from shukotsu.arrays import Array
from shukotsu.fit import chain_builder, fitted_motion, hand_tables
from shukotsu.fit.fit import HandFit, fit_hand
from shukotsu.simulate.random_hand import BONES, FINGERS, FLEXION, JOINTS
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import LAYOUT, Simulated, simulate
from shukotsu.study import stated_error, verdict
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import Poses, RecordingName

WRITTEN_TO = "accuracy.md", "two drawings"
PEOPLE = 24, 9500
DURATION_S = 25.0
FAR_MM, COVERED_95_SD = 5.0, 1.96
POSED_FRAMES = 150
JOINT_TYPES = {
    "thumb CMC": ("thumb_cmc",),
    "thumb MCP": ("thumb_mcp",),
    "thumb IP": ("thumb_ip",),
    "MCP 2-3": ("index_mcp", "middle_mcp"),
    "MCP 4-5": ("ring_mcp", "little_mcp"),
    **{kind.upper(): tuple(f"{digit}_{kind}" for digit in FINGERS) for kind in ("pip", "dip")},
}
OWN, OTHER = "own", "other"


@dataclass(frozen=True)
class Drawn:
    """A recorded calibration with its truth.

    Attributes
    ----------
    poses, hand : Poses, str
        The recording, and right or left.
    truth : mapping of str to array, shape (2, 3)
        By joint: mean centre in the frames of the parent's and the child's receiver, as they move on the
        skin, mm.
    centre_mm : mapping of str to array, shape (T, 3)
        By joint: centre in the transmitter's frame.
    flexion_deg : mapping of str to array, shape (T,)
        By joint: flexion.
    lengths_mm : mapping of str to float
        By bone: length.

    """

    poses: Poses
    hand: str
    truth: Mapping[str, Array]
    centre_mm: Mapping[str, Array]
    flexion_deg: Mapping[str, Array]
    lengths_mm: Mapping[str, float]


@dataclass(frozen=True)
class JointErrors:
    """Errors of one joint of one hand.

    Attributes
    ----------
    joint : str
        The joint.
    off_mm : array, shape (2, 3)
        Error of the centre in the parent's and in the child's receiver.
    inside : tuple of bool
        Whether each of them is within the stated 95 %.
    sd_mm : float
        Stated sd of the worse half.
    posed_mm : float
        Mean error over frames of the posed centre in the transmitter's frame.
    slope : float
        Slope of the fitted flexion over the true one.
    believed : bool
        Whether the report believes the joint.

    """

    joint: str
    off_mm: Array
    inside: tuple[bool | None, ...]
    sd_mm: float
    posed_mm: float
    slope: float
    believed: bool

    @property
    def child_mm(self) -> float:
        """Error in the child's receiver frame."""
        return float(np.linalg.norm(self.off_mm[1]))

    @property
    def worse_mm(self) -> float:
        """Error of the worse half."""
        return float(np.linalg.norm(self.off_mm, axis=1).max())


@dataclass(frozen=True)
class LengthError:
    """Error of a bone's length; inside : whether it is within the stated 95 %."""

    bone: str
    off_mm: float
    true_mm: float
    inside: bool


def run(n_hands: int, seed: int) -> Iterator[PrintedTable]:
    """Yield the tables over n_hands hands of each simulator."""
    joints, lengths = {}, {}
    for drawing in (OWN, OTHER):
        hands = of_each_person(partial(one_hand, drawing), n_hands, seed)
        joints[drawing] = [error for errors, _ in hands for error in errors]
        lengths[drawing] = [error for _, errors in hands for error in errors]
    yield errors_table(joints, lengths)
    yield kinds_table(joints)


def one_hand(drawing: str, seed: int) -> tuple[list[JointErrors], list[LengthError]]:
    """Draw, record and fit a hand; return the errors of its joints and lengths."""
    draw = _own if drawing == OWN else _other
    drawn = draw(seed, ("right", "left")[seed % 2])
    fit = fit_hand([drawn.poses], read_layout(LAYOUT), drawn.hand)
    return list(joint_errors(drawn, fit)), list(length_errors(drawn, fit))


def _own(seed: int, hand: str) -> Drawn:
    return simulated_hand(
        simulate(RecordingName("01", hand, "rom"), seed, Realism(), round(240 * DURATION_S))
    )


def simulated_hand(simulated: Simulated) -> Drawn:
    """Convert a recording of this project's simulator."""
    truth = simulated.truth
    return Drawn(
        simulated,
        simulated.name.hand,
        {name: np.array([joint.parent_mm, joint.child_mm]) for name, joint in truth.joints.items()},
        {name: truth.bone_position_mm[:, JOINTS.index(name) + 1] for name in truth.joints},
        {name: np.degrees(truth.angles_rad[:, JOINTS.index(name), FLEXION]) for name in truth.joints},
        {bone: float(truth.hand.length_mm[BONES.index(bone)]) for bone in BONES if "_" in bone},
    )


def _other(seed: int, hand: str) -> Drawn:
    recording = faultless_hands.other_recording(seed, hand, "rom", {}, duration_s=DURATION_S)
    truth = {
        joint.name: np.array([true_centres(recording, joint.name, end) for end in ends])
        for joint in read_layout(LAYOUT).solvable
        if {*(ends := (joint.parent_receiver, joint.child))} <= {*recording.poses.segments}
    }
    flexion_deg = {name: angles[:, 0] for name, angles in recording.true_angles_deg.items()}
    centre_mm, lengths_mm = recording.true_centre_mm, recording.true_lengths_mm
    return Drawn(recording.poses, hand, truth, centre_mm, flexion_deg, lengths_mm)


def joint_errors(drawn: Drawn, fit: HandFit) -> Iterator[JointErrors]:
    """Compare the joints of a fit with the truth."""
    step = max(1, len(drawn.poses.frame) // POSED_FRAMES)
    rows = np.arange(0, len(drawn.poses.frame), step)
    posed = fitted_motion.pose_hand(fit, drawn.poses.take(rows))
    wanted_mm = read_layout(LAYOUT).wanted_mm
    judged = {row["joint"]: verdict.judged_joint(row, wanted_mm) for row in hand_tables.joint_rows(fit)}
    believed = {name for name, row_of in judged.items() if row_of["verdict"] == verdict.BELIEVE}
    for name, joint in fit.joints.items():
        if name not in drawn.truth:
            continue
        off_mm = np.array([joint.parent_mm, joint.child_mm]) - drawn.truth[name]
        stated = stated_error.halves_mm2(joint.covariance_mm2, joint.sd_mm)
        posed_mm = posed.bone_position_mm[:, posed.bones.index(joint.child_segment)]
        flexion = np.degrees(posed.angles_rad[:, posed.angle_names.index((name, chain_builder.KINDS[0]))])
        inside = tuple(map(stated_error.is_within_95, off_mm, stated))
        posed_off_mm = float(np.nanmean(np.linalg.norm(posed_mm - drawn.centre_mm[name][rows], axis=1)))
        slope = float(np.polyfit(drawn.flexion_deg[name][rows], flexion, 1)[0])
        yield JointErrors(name, off_mm, inside, joint.sd_mm, posed_off_mm, slope, name in believed)


def length_errors(drawn: Drawn, fit: HandFit) -> Iterator[LengthError]:
    """Compare the lengths of a fit with the truth, except last bones, which end in soft tissue."""
    for name, bone in fit.bones.items():
        if not name.endswith("_distal"):
            off_mm = bone.length_mm - drawn.lengths_mm[name]
            inside = abs(off_mm) <= COVERED_95_SD * bone.sd_mm
            yield LengthError(name, off_mm, drawn.lengths_mm[name], inside)


def centre_numbers(joints: Sequence[JointErrors]) -> tuple[float, float, float]:
    """Return median and 90th percentile in the child's receiver, mm, and percent within the stated 95 %."""
    mm = [error.child_mm for error in joints]
    inside = percent([inside for joint in joints for inside in joint.inside])
    return float(np.median(mm)), float(np.percentile(mm, 90)), inside


def errors_table(
    joints: Mapping[str, Sequence[JointErrors]], lengths: Mapping[str, Sequence[LengthError]]
) -> PrintedTable:
    """Return the table of errors of centres, lengths and angles; joints, lengths : by simulator."""
    rows = []
    for name, of_drawing in joints.items():
        posed = [error.posed_mm for error in of_drawing]
        bones = lengths[name]
        middle = [100 * error.off_mm / error.true_mm for error in bones if error.bone.endswith("_middle")]
        median, p90, inside = centre_numbers(of_drawing)
        believed = [error for error in of_drawing if error.believed]
        rows.append(
            (
                name,
                median,
                p90,
                percent([error.child_mm > FAR_MM for error in of_drawing]),
                inside,
                float(np.mean([error.sd_mm for error in of_drawing])),
                float(np.median(posed)),
                float(np.percentile(posed, 90)),
                float(np.mean(middle)),
                percent([error.inside for error in bones]),
                percent([error.slope - 1 for error in of_drawing if error.joint.endswith("_dip")]),
                percent([error.believed for error in of_drawing]),
                max((error.worse_mm for error in believed), default=None),
                centre_numbers(believed)[2] if believed else None,
            )
        )
    columns = (
        "drawing", "median mm:.2f", "p90 mm:.2f", f"> {FAR_MM:.0f} mm %:.1f", "in 95 %:.1f",
        "mean sd mm:.2f", "posed: median mm:.2f", "p90 mm:.2f", "middle phalanges %:+.1f",
        "lengths in 95 %:.0f", "DIP flexion %:+.1f", "believed %:.0f", "worst mm:.1f", "in 95 %:.1f",
    )  # fmt: skip
    meaning = (
        "Mean centres in the frame of the child's receiver, which moves on the skin; in 95 %: centres in the "
        "parent's and in the child's receiver, compared with their covariance. Posed: error of the posed "
        "hand's centres in the transmitter's frame, mean over frames, with errors of the field. Own: this "
        "project's simulator; other: an independent one. Believed: centres that the report believes, and the "
        "largest error of their worse halves."
    )
    return PrintedTable("two drawings: errors", columns, rows, meaning)


def kinds_table(joints: Mapping[str, Sequence[JointErrors]]) -> PrintedTable:
    """Return the table of errors and coverage by kind of joint; joints : by simulator."""
    rows = [
        (name, kind, *centre_numbers([error for error in of_drawing if error.joint in names]))
        for name, of_drawing in joints.items()
        for kind, names in JOINT_TYPES.items()
    ]
    columns = ("drawing", "joints", "median mm:.2f", "p90 mm:.2f", "in 95 %:.1f")
    return PrintedTable("two drawings: by kind of joint", columns, rows, "As above.")
