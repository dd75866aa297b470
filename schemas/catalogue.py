"""Every table of the contract, declared once. `docs/tables.md` is made from this module.

Conventions: mm, s, degrees; unit quaternions (w, x, y, z) from the receiver's (or bone's) frame to the
transmitter's; text columns are never null, empty text means "nothing to say".
"""

from __future__ import annotations

import pyarrow as pa

from shukotsu.schemas.model_tables import MODEL_TABLES
from shukotsu.schemas.movement_tables import MOVEMENT_TABLES
from shukotsu.schemas.table_columns import (
    DIGIT,
    FRAME,
    HAND,
    JOINT,
    JOINT_STATUS,
    JUDGEMENT,
    MESSAGE,
    OF_RECORDING,
    OF_SKELETON,
    OF_SKELETON_IN_RECORDING,
    REAL,
    REASON_VALUES,
    SESSION,
    STATUS,
    SUBJECT,
    TEXT,
    WHOLE,
    YES_NO,
)
from shukotsu.schemas.table_columns import quaternion as _quaternion
from shukotsu.schemas.table_columns import real as _real
from shukotsu.schemas.table_columns import xyz as _xyz
from shukotsu.schemas.tables import Column, Table

POSES = Table(
    "poses",
    1,
    "every segment of the layout at every frame that any of them has",
    (
        Column("segment", TEXT, "", "the bone's rigid body that the receiver rides on"),
        FRAME,
        _real("time_s", "device time as recorded; null where the recording has none"),
        *_xyz("", "mm", "receiver origin in the transmitter frame"),
        *_quaternion("receiver to transmitter frame, unit"),
        Column("valid", YES_NO, "", "whether this pose may be used"),
        Column("flags", TEXT, "", "what was seen, words joined by ';' (see docs/recordings.md)"),
    ),
    ("segment", "frame"),
)

_VARIANT = Column("variant", TEXT, "", "which of the kind's sentences says it")
_VALUES = Column("values", TEXT, "", "what the sentence is made of, as JSON; empty where there is none")
_ACCEPTED = Column("accepted", TEXT, "", "the reason by which the study lets a suspect finding stand")

FINDINGS = Table(
    "findings",
    3,
    "what was declared of a recording and its poses contradict, likeliest first",
    (
        *OF_RECORDING,
        Column("kind", TEXT, "", "what it is, a kind of docs/mistakes.md"),
        Column("severity", TEXT, "", "refused (not used), suspect (judges nothing) or note"),
        _VARIANT,
        _VALUES,
        _ACCEPTED,
        Column("message", TEXT, "", "in English: what is seen, what it probably is, what to write"),
    ),
    ("subject", "session", "hand", "task", "trial", "kind", "message"),
)

AS_IT_RODE = "where it was on average over the recording, as the receiver rode on the skin"

AT_ZERO = "where the joint's angles are zero"

JOINT_SOLUTIONS = Table(
    "joint_solutions",
    4,
    "the joint as Eq. 1-7 give it, before the plane",
    (
        *OF_SKELETON,
        JOINT,
        Column("parent_segment", TEXT, "", "segment of the parent receiver; empty where none is worn"),
        Column("child_segment", TEXT, "", "segment of the child receiver"),
        *_xyz("parent_", "mm", f"joint centre in the parent receiver's frame, {AS_IT_RODE}"),
        *_xyz("child_", "mm", f"joint centre in the child receiver's frame, {AS_IT_RODE}"),
        *_xyz(
            "null_parent_", "", "parent half of the stack's last right singular vector (scaled to length 1)"
        ),
        *_xyz("null_child_", "", "child half of the stack's last right singular vector (same scale)"),
        *(
            Column(f"mean_rotation_{i}{j}", REAL, "", f"mean of R_parent^T R_child, row {i} column {j}", True)
            for i in "xyz"
            for j in "xyz"
        ),
        Column(
            "singular_values",
            pa.list_(REAL, 6),
            "",
            "singular values of the stacked matrix divided by sqrt(frames), largest first",
            True,
        ),
        Column(
            "covariance_mm2",
            pa.list_(REAL, 36),
            "mm^2",
            "covariance of (parent, child) centre, 6 x 6 by rows, the axis direction left out",
            True,
        ),
        _real("gap_rms_mm", "rms gap of the centre given here"),
        _real("gap_rms_free_mm", "rms gap of the unconstrained six-unknown fit"),
        _real("slide_to_free_mm", "from this centre along the axis to that fit's"),
        _real("range_deg", "range of motion about the axis"),
        _real("spread_deg", "standard deviation of the angle about the axis"),
        _real("axis_sd_deg", "1-sigma direction error of the axis"),
        Column("n_frames", WHOLE, "", "frames in which both receivers were valid"),
        _real("n_effective", "independent samples among them, from the gap's autocorrelation"),
        REASON_VALUES,
        STATUS,
        MESSAGE,
    ),
    ("subject", "session", "hand", "model", "made_without", "joint"),
)

JOINT_CENTRES = Table(
    "joint_centres",
    4,
    "the skeleton's joints, the wrist point in use among them",
    (
        *OF_SKELETON,
        JOINT,
        Column("parent_segment", TEXT, "", "segment of the parent receiver; empty where none is worn"),
        Column("child_segment", TEXT, "", "segment of the child receiver"),
        Column("dof", pa.int8(), "", "degrees of freedom that the model gave the joint"),
        *_xyz("parent_", "mm", f"joint centre in the parent receiver's frame, {AS_IT_RODE}"),
        *_xyz("child_", "mm", f"joint centre in the child receiver's frame, {AS_IT_RODE}"),
        *_xyz("axis_parent_", "", "unit rotation axis in the parent receiver's frame"),
        *_xyz("axis_child_", "", "unit rotation axis in the child receiver's frame"),
        _real(
            "sd_mm",
            "1-sigma error of the centre in 3-D, with what skin and the receivers' places leave open",
        ),
        _real(
            "scatter_sd_mm",
            "of that what the scatter of the frames alone says; null where anatomy was weighed in",
        ),
        Column(
            "covariance_mm2",
            pa.list_(REAL, 36),
            "mm^2",
            "covariance of (parent, child) centre, 6 x 6 by rows",
            True,
        ),
        _real("gap_rms_mm", "rms gap of this centre over the calibration frames"),
        _real("gap_rms_free_mm", "rms gap of the unconstrained six-unknown fit"),
        _real("range_deg", "range of motion about the axis"),
        _real("axis_sd_deg", "1-sigma direction error of the axis"),
        _real("rest_flexion_deg", f"flexion of the child bone's frame in its parent's {AT_ZERO}"),
        _real("rest_abduction_deg", f"abduction of the child bone's frame in its parent's {AT_ZERO}"),
        _real("rest_rotation_deg", f"axial rotation of the child bone's frame in its parent's {AT_ZERO}"),
        _real(
            "axes_turn_deg", "pronation about the child bone from its frame to the axes of the joint's angles"
        ),
        _real("axes_turn_sd_deg", "1-sigma error of that"),
        _real("axis_plane_deg", "angle between the axis and the plane that cuts it"),
        _real("slide_mm", "how far the plane moved the centre along the axis"),
        _real("correction_mm", "length of the manual correction; null where there is none"),
        Column("n_frames", WHOLE, "", "calibration frames in which both receivers were valid"),
        _real("n_effective", "independent samples among them"),
        Column("source", TEXT, "", "where the centre comes from (fit, configured point, estimated point)"),
        *JUDGEMENT,
        JOINT_STATUS,
        MESSAGE,
    ),
    ("subject", "session", "hand", "model", "made_without", "joint"),
)

METACARPALS = Table(
    "metacarpals",
    3,
    "posture of the digit's metacarpal",
    (
        *OF_SKELETON_IN_RECORDING,
        DIGIT,
        FRAME,
        *_quaternion("metacarpal (x distal, z dorsal) to transmitter frame"),
        _real("swing_deg", "swing since the reference frame (Eq. 9), in the hand"),
        _real("twist_deg", "twist about the bone since the reference frame (Eq. 11)"),
        _real("length_mm", "distance from the bone's base to the MCP joint, |v(k)|"),
        Column("flags", TEXT, "", "words joined by ';': gap, twist-near-singular, swing-near-singular"),
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

TIPS = Table(
    "tips",
    3,
    "the replayed tip (the distal receiver's origin), least-squares binding",
    (
        *OF_SKELETON_IN_RECORDING,
        DIGIT,
        FRAME,
        _real("time_s", "device time as recorded"),
        *_xyz(
            "tip_",
            "mm",
            "replayed tip as the paper has it, the origin of the distal receiver and neither the bone's end "
            "nor the skin's, in the transmitter frame, least-squares binding",
        ),
        _real("error_mm", "its distance to the distal receiver"),
        _real("error_first_frame_mm", "the same with the paper's first-frame binding"),
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

TIP_ERRORS = Table(
    "tip_errors",
    3,
    "the paper's table, one cell group a row",
    (
        *OF_SKELETON_IN_RECORDING,
        DIGIT,
        Column("binding", TEXT, "", "first-frame (the paper's) or least-squares"),
        _real("max_mm", "largest tip error over the frames"),
        _real("min_mm", "smallest"),
        _real("mean_mm", "mean"),
        _real("sd_mm", "standard deviation over the frames (divided by n)"),
        _real("median_mm", "median"),
        _real("p95_mm", "95th percentile"),
        Column("n_frames", WHOLE, "", "frames with an error: every receiver of the digit valid"),
        Column("n_frames_total", WHOLE, "", "frames of the recording"),
        Column("held_out", YES_NO, "", "whether the joints were solved without this recording"),
        MESSAGE,
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "digit", "binding"),
)

BONE_TIP, DISTAL_RECEIVER = "bone tip", "distal receiver"
"""Where a digit's last bone may end."""

BONE_LENGTHS = Table(
    "bone_lengths",
    4,
    "a bone is named after its segment",
    (
        *OF_SKELETON,
        DIGIT,
        Column("bone", TEXT, "", "the segment"),
        Column(
            "starts_at", TEXT, "", "joint at whose centre it starts: its own, or the wrist if merged with it"
        ),
        Column(
            "ends_at",
            TEXT,
            "",
            f"joint at whose centre it ends; of a digit's last bone {BONE_TIP!r} where the whole hand was "
            f"fitted, else {DISTAL_RECEIVER!r}, the paper's tip; skin and pulp end beyond either",
        ),
        _real("length_mm", "distance between the two"),
        _real("sd_mm", "1-sigma error of the length"),
        *_xyz("", "mm", "the bone as the replay has it, to the next joint or receiver, in driven_by's frame"),
        Column("driven_by", TEXT, "", "the segment whose receiver turns the bone; empty where none does"),
        _real("sd_over_frames_mm", "metacarpals: SD of |v(k)|, which a true skeleton keeps at 0"),
        *JUDGEMENT,
        MESSAGE,
    ),
    ("subject", "session", "hand", "model", "made_without", "digit", "bone"),
)

RECEIVERS = Table(
    "receivers",
    3,
    "where the receiver sits on its bone and how it behaves, as fitted",
    (
        *OF_SKELETON,
        Column("segment", TEXT, "", "the segment that wears the receiver"),
        *(
            column
            for name, meaning in (
                ("along", "distally from the bone's proximal joint"),
                ("lateral", "towards the thumb"),
                ("height", "dorsally from the line between the bone's joints"),
            )
            for column in (
                Column(f"{name}_mm", REAL, "mm", f"place of its origin on the bone, {meaning}", True),
                Column(f"{name}_sd_mm", REAL, "mm", "1-sigma error of that", True),
            )
        ),
        *_xyz("bone_tip_", "mm", "a digit's last: end of the bone in the receiver's own frame"),
        _real("bone_tip_sd_mm", "1-sigma error of that in 3-D"),
        *_xyz("soft_tip_", "mm", "a digit's last: end of the digit, skin and all (skin_tip), likewise"),
        _real("soft_tip_sd_mm", "1-sigma error of that in 3-D"),
        _real("residual_mm", "rms per component of its position about the fitted hand"),
        _real("residual_deg", "rms per component of its rotation about the fitted hand"),
        Column(
            "loose_kind", TEXT, "", "what displaced it: step, slide or field (as by metal); empty: nothing"
        ),
        Column("loose_from_frame", WHOLE, "", "frame from which it sits elsewhere; null: it stayed", True),
        Column("loose_until_frame", WHOLE, "", "frame until which it slid; of a step, the same", True),
        Column("loose_task", TEXT, "", "task and trial in which that happened; empty: it stayed"),
        _real("loose_shift_mm", "how far it moved then, or is off in the field"),
        _real("loose_turn_deg", "how far it turned then, or is off in the field"),
        *_xyz("field_", "mm", "where it came nearest to what disturbs the field, in the transmitter frame"),
        _real("left_out_share", "share of its calibration frames that was left out for that"),
        STATUS,
        MESSAGE,
    ),
    ("subject", "session", "hand", "model", "made_without", "segment"),
)

MOVED_RECEIVERS = Table(
    "moved_receivers",
    1,
    "a receiver that sits elsewhere on its bone in an evaluated recording than in the calibration",
    (
        *OF_SKELETON_IN_RECORDING,
        Column("segment", TEXT, "", "the segment that wears the receiver"),
        Column("from_frame", WHOLE, "", "frame from which it sits elsewhere; the first one: all along"),
        _real("from_s", "its time; null where the recording has none"),
        _real(
            "shift_mm", "how far it moved, at least: about its joint's own axis it may have turned further"
        ),
        _real("turn_deg", "how far it turned, at least"),
        Column("joints", TEXT, "", "joints beside it, joined by ';': from then on they have no angles"),
        Column("digits", TEXT, "", "digits, joined by ';', that from then on have no tips"),
        MESSAGE,
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "segment"),
)

GAINS = Table(
    "gains",
    3,
    "what measuring one more thing on the hand would gain, best first",
    (
        *OF_SKELETON,
        Column("quantity", TEXT, "", "what could be measured, as measurements.tsv calls it"),
        Column("sd_mm", REAL, "mm", "1-sigma error that the measurement is assumed to have"),
        Column("mean_sd_before_mm", REAL, "mm", "mean sd_mm of the hand's joint centres now"),
        Column("mean_sd_after_mm", REAL, "mm", "the same with that measurement"),
        Column("joint", TEXT, "", "the joint that would gain most"),
        Column("joint_sd_before_mm", REAL, "mm", "its sd_mm now"),
        Column("joint_sd_after_mm", REAL, "mm", "the same with that measurement"),
    ),
    ("subject", "session", "hand", "model", "made_without", "quantity"),
)

IN_THIS_FRAME = "in this frame, by the receivers valid in it and what the fit leaves open"

JOINT_ANGLES = Table(
    "joint_angles",
    5,
    "the joint's angles with the fitted hand",
    (
        *OF_SKELETON_IN_RECORDING,
        JOINT,
        FRAME,
        _real("flexion_deg", "flexion positive, extension negative (docs/joint-angles.md)"),
        _real("abduction_deg", "abduction or deviation, signed as docs/joint-angles.md says"),
        _real("rotation_deg", "axial rotation, signed as docs/joint-angles.md says"),
        _real("flexion_sd_deg", f"1-sigma error of flexion_deg {IN_THIS_FRAME}"),
        _real("abduction_sd_deg", "the same of abduction_deg"),
        _real("rotation_sd_deg", "the same of rotation_deg"),
        _real(
            "flexion_change_sd_deg",
            "1-sigma error of flexion_deg minus its mean over the recording's first frames, without "
            "what the fit leaves open of both alike",
        ),
        _real("abduction_change_sd_deg", "the same of abduction_deg"),
        _real("rotation_change_sd_deg", "the same of rotation_deg"),
        _real("flexion_session_sd_deg", "1-sigma of what differs when the receivers are put on anew"),
        _real("abduction_session_sd_deg", "the same of abduction_deg"),
        _real("rotation_session_sd_deg", "the same of rotation_deg"),
        _real("flexion_session_change_sd_deg", "of flexion_change_sd_deg, what differs so"),
        _real("abduction_session_change_sd_deg", "the same of abduction_deg"),
        _real("rotation_session_change_sd_deg", "the same of rotation_deg"),
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "joint", "frame"),
)

BONE_POSES = Table(
    "bone_poses",
    4,
    "a bone of the fitted hand, posed with all receivers",
    (
        *OF_SKELETON_IN_RECORDING,
        Column("segment", TEXT, "", "the bone; those that carry no receiver among them"),
        FRAME,
        *_xyz(
            "", "mm", "centre of the bone's proximal joint (of the hand: the wrist) in the transmitter frame"
        ),
        *_quaternion("bone (x distal, z dorsal) to transmitter frame"),
        _real("sd_mm", f"1-sigma error of the centre in 3-D {IN_THIS_FRAME}"),
        _real("turn_sd_deg", "the same of the rotation, root of the sum over three axes"),
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "segment", "frame"),
)

POSED_TIPS = Table(
    "posed_tips",
    4,
    "both tips, of bone and of skin, of a digit of the fitted hand, posed with all receivers",
    (
        *OF_SKELETON_IN_RECORDING,
        DIGIT,
        FRAME,
        _real("time_s", "device time as recorded"),
        *_xyz("tip_", "mm", "end of the distal bone, under the skin, in the transmitter frame"),
        *_xyz("skin_tip_", "mm", "end of the digit, skin and all, in the transmitter frame"),
        _real("tip_sd_mm", f"1-sigma error of the bone's end in 3-D {IN_THIS_FRAME}"),
        _real("skin_tip_sd_mm", "the same of the skin's end"),
        _real("error_mm", "from where the hand says that the distal receiver is to where it is"),
        _real(
            "error_left_out_mm",
            "the same with the positions of all distal receivers left out of the pose; null in frames that "
            "were not tried",
        ),
        _real("residual_mm", "rms distance of all receivers of the hand in this frame"),
    ),
    ("subject", "session", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

CALIBRATED_ON = Column(
    "calibrated_on",
    TEXT,
    "",
    "tasks (and trials) that the skeleton was made from, joined by ';'; empty: none",
)

SKELETON_SCORES = Table(
    "skeleton_scores",
    2,
    "how well a skeleton does in one recording",
    (
        *OF_RECORDING,
        Column(
            "model",
            TEXT,
            "",
            "the skeleton model, or a reference: prior-only, distal-receiver, true-skeleton",
        ),
        CALIBRATED_ON,
        Column("held_out", YES_NO, "", "whether the skeleton was made without this recording's task"),
        Column("reference", YES_NO, "", "whether this is a reference and no model of the study"),
        DIGIT,
        _real("replay_mean_mm", "tip error of the receiver-driven replay, mean over frames"),
        _real("replay_p95_mm", "the same, 95th percentile"),
        _real("posed_mean_mm", "tip error of the fitted hand posed with all receivers, mean"),
        _real("left_out_mean_mm", "the same with the distal receivers' positions left out, mean"),
        _real("left_out_p95_mm", "the same, 95th percentile"),
        _real(
            "wrist_mcp_sd_mm", "SD over the frames of the distance from the wrist to the digit's MCP joint"
        ),
        _real("metacarpal_deg", "simulated: mean angle to the metacarpal's true direction"),
        _real("true_tip_mean_mm", "simulated: mean distance to the true end of the distal bone"),
        _real("true_tip_p95_mm", "the same, 95th percentile"),
        Column("n_frames", WHOLE, "", "frames scored"),
        MESSAGE,
    ),
    ("subject", "session", "hand", "task", "trial", "model", "calibrated_on", "digit"),
)

JOINT_ERRORS = Table(
    "joint_errors",
    2,
    "simulated hands only, how far a joint is from its truth",
    (
        SUBJECT,
        SESSION,
        HAND,
        Column("model", TEXT, "", "the skeleton model, or the reference prior-only"),
        CALIBRATED_ON,
        JOINT,
        _real(
            "error_mm",
            "distance of the centre to the true one, in the child receiver's frame as it rode on skin",
        ),
        _real("along_mm", "its part along the true axis"),
        _real("across_mm", "its part across the true axis"),
        _real("parent_error_mm", "the distance in the parent receiver's frame"),
        _real("axis_deg", "angle between the axis and the true one (hinges)"),
        _real("sd_mm", "the stated 1-sigma error of the centre"),
        Column("within_95", YES_NO, "", "whether the worse half is within the stated 95 % radius", True),
        Column("bone", TEXT, "", "the bone that starts at the joint; empty where its length is not stated"),
        _real("bone_error_mm", "its stated length minus the true one"),
        _real("bone_error_percent", "the same, of the true one"),
    ),
    ("subject", "session", "hand", "model", "calibrated_on", "joint"),
)

RECORDINGS = Table(
    "recordings",
    3,
    "recording of the study: what became of it",
    (
        *OF_RECORDING,
        Column("role", TEXT, "", "calibration, evaluation or both"),
        Column("file", TEXT, "", "the recording's file, as in the sheet"),
        Column("status", TEXT, "", "used, excluded (by the sheet), refused (by a finding) or failed"),
        Column("tracker", TEXT, "", "what recorded it, where its file says so", nullable=True),
        Column("n_frames", WHOLE, "", "frames of the recording"),
        Column("n_receivers", WHOLE, "", "receivers of which a pose may be used"),
        _real("duration_s", "time in which frames were recorded: pauses and jumps of the clock left out"),
        _real(
            "valid_percent",
            "poses that may be used, of those that the layout expects in all frames, missing ones too",
        ),
        MESSAGE,
    ),
    ("subject", "session", "hand", "task", "trial"),
)

PROBLEMS = Table(
    "problems",
    4,
    "a finding: anything that did not go as the study asked",
    (
        Column("subject", TEXT, "", "whose; empty: of the whole study"),
        Column("session", TEXT, "", "in which session; empty: of no single one, or the sheet names none"),
        Column("hand", TEXT, "", "right or left; empty: of no single hand"),
        Column("task", TEXT, "", "task, and trial, of the recording; empty: of no single one"),
        Column("model", TEXT, "", "the skeleton model; empty: of no single one"),
        Column("stage", TEXT, "", "the stage that met it"),
        Column(
            "kind",
            TEXT,
            "",
            "recording, hand, skeleton, receiver, receiver-loose, receiver-slid, receiver-moved, "
            "field-disturbed, knuckles-too-close, correction or a kind of docs/mistakes.md",
        ),
        Column("severity", TEXT, "", "refused (no result), suspect or note"),
        _VARIANT,
        _VALUES,
        _ACCEPTED,
        MESSAGE,
    ),
    (),
)

TABLES = {
    table.name: table
    for table in (
        POSES,
        FINDINGS,
        JOINT_SOLUTIONS,
        JOINT_CENTRES,
        METACARPALS,
        TIPS,
        TIP_ERRORS,
        BONE_LENGTHS,
        RECEIVERS,
        MOVED_RECEIVERS,
        GAINS,
        JOINT_ANGLES,
        BONE_POSES,
        POSED_TIPS,
        SKELETON_SCORES,
        JOINT_ERRORS,
        RECORDINGS,
        PROBLEMS,
        *MOVEMENT_TABLES,
        *MODEL_TABLES,
    )
}
