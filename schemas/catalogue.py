"""Every table of the contract, declared once. `docs/tables.md` is made from this module.

Conventions: mm, s, degrees; unit quaternions (w, x, y, z) from the receiver's (or bone's) frame to the
transmitter's; text columns are never null, empty text means "nothing to say".
"""

from __future__ import annotations

import pyarrow as pa

from schemas.tables import Column, Table

TEXT, REAL, WHOLE, YES_NO = pa.string(), pa.float64(), pa.int64(), pa.bool_()
SINGLE = pa.float32()

SUBJECT = Column("subject", TEXT, "", "the subject's name, as in the recordings sheet")
HAND = Column("hand", TEXT, "", "right or left")
TASK = Column("task", TEXT, "", "what was done, as in the recordings sheet")
TRIAL = Column("trial", TEXT, "", "which repetition; empty where the sheet names none")
MODEL = Column("model", TEXT, "", "the skeleton model")
MADE_WITHOUT = Column(
    "made_without", TEXT, "", "task whose recordings the skeleton was made without; empty: of all"
)
DIGIT = Column("digit", TEXT, "", "the digit, as the layout names it")
FRAME = Column("frame", WHOLE, "", "the tracker's own frame number, kept as it came")
MESSAGE = Column("message", TEXT, "", "in words, why a result is weak or missing")
STATUS = Column("status", TEXT, "", "ok, weak (read the message) or failed (no usable number)")


def _xyz(prefix: str, unit: str, description: str, *, nullable: bool = True) -> tuple[Column, ...]:
    suffix = f"_{unit}" if unit else ""
    return tuple(
        Column(f"{prefix}{axis}{suffix}", REAL, unit, f"{description}, {axis}", nullable) for axis in "xyz"
    )


def _quaternion(description: str) -> tuple[Column, ...]:
    return tuple(Column(f"q{part}", REAL, "", f"{description}, {part}", nullable=True) for part in "wxyz")


POSES = Table(
    "poses",
    1,
    "every segment of the layout at every frame that any of them has",
    (
        Column("segment", TEXT, "", "the bone's rigid body that the receiver rides on"),
        FRAME,
        Column("time_s", REAL, "s", "device time as recorded; null where the recording has none", True),
        *_xyz("", "mm", "receiver origin in the transmitter frame"),
        *_quaternion("receiver to transmitter frame, unit"),
        Column("valid", YES_NO, "", "whether this pose may be used"),
        Column("flags", TEXT, "", "what was seen, words joined by ';' (see docs/recordings.md)"),
    ),
    ("segment", "frame"),
)

CAPTURE_RECORDS = Table(
    "capture_records",
    1,
    "record that the tracker sent, in the order of its bytes",
    (
        Column("station", pa.int16(), "", "the tracker's station number"),
        FRAME,
        Column("time_s", REAL, "s", "device time of the frame, from the recording's first frame"),
        Column("device_ms", WHOLE, "ms", "the tracker's own clock, as sent", True),
        *(Column(f"{axis}_mm", SINGLE, "mm", f"receiver origin as sent, {axis}", True) for axis in "xyz"),
        *(
            Column(f"q{part}", SINGLE, "", f"receiver to transmitter frame, as sent, {part}", True)
            for part in "wxyz"
        ),
        *(
            Column(
                f"repaired_{axis}_mm",
                SINGLE,
                "mm",
                f"where asked for: receiver origin with hemisphere flips put back, {axis}",
                True,
            )
            for axis in "xyz"
        ),
        Column("error", pa.uint8(), "", "ASCII code of the tracker's error letter; 0 for none"),
        Column(
            "distortion", pa.int16(), "", "as sent: 0 none, 1 minor, 2 significant (VIPER: 0 to 255)", True
        ),
        Column("button", pa.int8(), "", "stylus button, as sent", True),
        Column("sync", pa.int8(), "", "external sync, as sent", True),
        Column("host_ns", WHOLE, "ns", "the host's monotonic clock when the record's last byte had come"),
        Column("offset", WHOLE, "", "place of its first byte in the stream"),
        Column("flags", pa.uint16(), "", "what was seen, a bit each (see docs/recording.md)"),
    ),
    ("host_ns", "offset"),
)

FINDINGS = Table(
    "findings",
    1,
    "what was declared of a recording and its poses contradict, likeliest first",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        Column("kind", TEXT, "", "what it is, a kind of docs/mistakes.md"),
        Column("severity", TEXT, "", "refused (not used), suspect (judges nothing) or note"),
        Column("message", TEXT, "", "what is seen, what it probably is, what to write"),
    ),
    ("subject", "hand", "task", "trial", "kind", "message"),
)

JOINT_SOLUTIONS = Table(
    "joint_solutions",
    2,
    "the joint as Eq. 1-7 give it, before the plane",
    (
        SUBJECT,
        HAND,
        MODEL,
        MADE_WITHOUT,
        Column("joint", TEXT, "", "the joint, as the layout names it"),
        Column("parent_segment", TEXT, "", "segment of the parent receiver; empty where none is worn"),
        Column("child_segment", TEXT, "", "segment of the child receiver"),
        *_xyz("parent_", "mm", "joint centre in the parent receiver's frame"),
        *_xyz("child_", "mm", "joint centre in the child receiver's frame"),
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
        Column("gap_rms_mm", REAL, "mm", "rms gap of the centre given here", True),
        Column("gap_rms_free_mm", REAL, "mm", "rms gap of the unconstrained six-unknown fit", True),
        Column("slide_to_free_mm", REAL, "mm", "from this centre along the axis to that fit's", True),
        Column("range_deg", REAL, "deg", "range of motion about the axis", True),
        Column("spread_deg", REAL, "deg", "standard deviation of the angle about the axis", True),
        Column("axis_sd_deg", REAL, "deg", "1-sigma direction error of the axis", True),
        Column("n_frames", WHOLE, "", "frames in which both receivers were valid"),
        Column(
            "n_effective", REAL, "", "independent samples among them, from the gap's autocorrelation", True
        ),
        STATUS,
        MESSAGE,
    ),
    ("subject", "hand", "model", "made_without", "joint"),
)

JOINT_CENTRES = Table(
    "joint_centres",
    2,
    "the skeleton's joints, the wrist point in use among them",
    (
        SUBJECT,
        HAND,
        MODEL,
        MADE_WITHOUT,
        Column("joint", TEXT, "", "the joint, as the layout names it"),
        Column("parent_segment", TEXT, "", "segment of the parent receiver; empty where none is worn"),
        Column("child_segment", TEXT, "", "segment of the child receiver"),
        Column("dof", pa.int8(), "", "degrees of freedom that the model gave the joint"),
        *_xyz("parent_", "mm", "joint centre in the parent receiver's frame"),
        *_xyz("child_", "mm", "joint centre in the child receiver's frame"),
        *_xyz("axis_parent_", "", "unit rotation axis in the parent receiver's frame"),
        *_xyz("axis_child_", "", "unit rotation axis in the child receiver's frame"),
        Column(
            "sd_mm",
            REAL,
            "mm",
            "1-sigma error of the centre in 3-D, with what skin and the receivers' places leave open",
            True,
        ),
        Column(
            "scatter_sd_mm",
            REAL,
            "mm",
            "of that what the scatter of the frames alone says; null where anatomy was weighed in",
            True,
        ),
        Column(
            "covariance_mm2",
            pa.list_(REAL, 36),
            "mm^2",
            "covariance of (parent, child) centre, 6 x 6 by rows",
            True,
        ),
        Column("gap_rms_mm", REAL, "mm", "rms gap of this centre over the calibration frames", True),
        Column("gap_rms_free_mm", REAL, "mm", "rms gap of the unconstrained six-unknown fit", True),
        Column("range_deg", REAL, "deg", "range of motion about the axis", True),
        Column("axis_sd_deg", REAL, "deg", "1-sigma direction error of the axis", True),
        Column("axis_plane_deg", REAL, "deg", "angle between the axis and the plane that cuts it", True),
        Column("slide_mm", REAL, "mm", "how far the plane moved the centre along the axis", True),
        Column(
            "correction_mm", REAL, "mm", "length of the manual correction; null where there is none", True
        ),
        Column("n_frames", WHOLE, "", "calibration frames in which both receivers were valid"),
        Column("n_effective", REAL, "", "independent samples among them", True),
        Column("source", TEXT, "", "where the centre comes from (fit, configured point, estimated point)"),
        STATUS,
        MESSAGE,
    ),
    ("subject", "hand", "model", "made_without", "joint"),
)

METACARPALS = Table(
    "metacarpals",
    2,
    "posture of the digit's metacarpal",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        DIGIT,
        FRAME,
        *_quaternion("metacarpal (x distal, z dorsal) to transmitter frame"),
        Column("swing_deg", REAL, "deg", "swing since the reference frame (Eq. 9), in the hand", True),
        Column("twist_deg", REAL, "deg", "twist about the bone since the reference frame (Eq. 11)", True),
        Column("length_mm", REAL, "mm", "distance from the bone's base to the MCP joint, |v(k)|", True),
        Column("flags", TEXT, "", "words joined by ';': gap, twist-near-singular, swing-near-singular"),
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

TIPS = Table(
    "tips",
    2,
    "the replayed fingertip, least-squares binding",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        DIGIT,
        FRAME,
        Column("time_s", REAL, "s", "device time as recorded", True),
        *_xyz("tip_", "mm", "replayed fingertip in the transmitter frame, least-squares binding"),
        Column("error_mm", REAL, "mm", "its distance to the distal receiver", True),
        Column("error_first_frame_mm", REAL, "mm", "the same with the paper's first-frame binding", True),
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

TIP_ERRORS = Table(
    "tip_errors",
    2,
    "the paper's table, one cell group a row",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        DIGIT,
        Column("binding", TEXT, "", "first-frame (the paper's) or least-squares"),
        Column("max_mm", REAL, "mm", "largest tip error over the frames", True),
        Column("min_mm", REAL, "mm", "smallest", True),
        Column("mean_mm", REAL, "mm", "mean", True),
        Column("sd_mm", REAL, "mm", "standard deviation over the frames (divided by n)", True),
        Column("median_mm", REAL, "mm", "median", True),
        Column("p95_mm", REAL, "mm", "95th percentile", True),
        Column("n_frames", WHOLE, "", "frames with an error: every receiver of the digit valid"),
        Column("n_frames_total", WHOLE, "", "frames of the recording"),
        Column("held_out", YES_NO, "", "whether the joints were solved without this recording"),
        MESSAGE,
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "digit", "binding"),
)

FINGERTIP, DISTAL_RECEIVER = "fingertip", "distal receiver"
"""Where a digit's last bone may end."""

BONE_LENGTHS = Table(
    "bone_lengths",
    2,
    "a bone is named after its segment",
    (
        SUBJECT,
        HAND,
        MODEL,
        MADE_WITHOUT,
        DIGIT,
        Column("bone", TEXT, "", "the segment"),
        Column(
            "starts_at", TEXT, "", "joint at whose centre it starts: its own, or the wrist if merged with it"
        ),
        Column(
            "ends_at",
            TEXT,
            "",
            f"joint at whose centre it ends; of a digit's last bone {FINGERTIP!r} where the whole hand was "
            f"fitted, else {DISTAL_RECEIVER!r}, which the paper takes for the tip",
        ),
        Column("length_mm", REAL, "mm", "distance between the two", True),
        Column("sd_mm", REAL, "mm", "1-sigma error of the length", True),
        *_xyz("", "mm", "the bone as the replay has it, to the next joint or receiver, in driven_by's frame"),
        Column("driven_by", TEXT, "", "the segment whose receiver turns the bone; empty where none does"),
        Column(
            "sd_over_frames_mm",
            REAL,
            "mm",
            "metacarpals: SD of |v(k)|, which a true skeleton keeps at 0",
            True,
        ),
        MESSAGE,
    ),
    ("subject", "hand", "model", "made_without", "digit", "bone"),
)

CALIBRATION_ADVICE = Table(
    "calibration_advice",
    1,
    "whether the calibration moves the joint enough, and what more would gain",
    (
        SUBJECT,
        HAND,
        Column("joint", TEXT, "", "the joint, as the layout names it"),
        Column("range_deg", REAL, "deg", "range of motion that it has there", True),
        Column("sd_now_mm", REAL, "mm", "1-sigma error of its centre, joint by joint with anatomy", True),
        Column("sd_moved_mm", REAL, "mm", "the same if it moved as the advice says", True),
        Column("advice", TEXT, "", "in words, what to move"),
    ),
    ("subject", "hand", "joint"),
)

RECEIVERS = Table(
    "receivers",
    2,
    "where the receiver sits on its bone and how it behaves, as fitted",
    (
        SUBJECT,
        HAND,
        MODEL,
        MADE_WITHOUT,
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
        Column("bone_tip_sd_mm", REAL, "mm", "1-sigma error of that in 3-D", True),
        *_xyz("soft_tip_", "mm", "a digit's last: end of the digit, skin and all, likewise"),
        Column("soft_tip_sd_mm", REAL, "mm", "1-sigma error of that in 3-D", True),
        Column("residual_mm", REAL, "mm", "rms per component of its position about the fitted hand", True),
        Column("residual_deg", REAL, "deg", "rms per component of its rotation about the fitted hand", True),
        Column("loose_from_frame", WHOLE, "", "frame from which it sits elsewhere; null: it stayed", True),
        Column("loose_task", TEXT, "", "task and trial in which that happened; empty: it stayed"),
        Column("loose_shift_mm", REAL, "mm", "how far it moved then", True),
        Column("loose_turn_deg", REAL, "deg", "how far it turned then", True),
        STATUS,
        MESSAGE,
    ),
    ("subject", "hand", "model", "made_without", "segment"),
)

GAINS = Table(
    "gains",
    2,
    "what measuring one more thing on the hand would gain, best first",
    (
        SUBJECT,
        HAND,
        MODEL,
        MADE_WITHOUT,
        Column("quantity", TEXT, "", "what could be measured, as measurements.tsv calls it"),
        Column("sd_mm", REAL, "mm", "1-sigma error that the measurement is assumed to have"),
        Column("mean_sd_before_mm", REAL, "mm", "mean sd_mm of the hand's joint centres now"),
        Column("mean_sd_after_mm", REAL, "mm", "the same with that measurement"),
        Column("joint", TEXT, "", "the joint that would gain most"),
        Column("joint_sd_before_mm", REAL, "mm", "its sd_mm now"),
        Column("joint_sd_after_mm", REAL, "mm", "the same with that measurement"),
    ),
    ("subject", "hand", "model", "made_without", "quantity"),
)

JOINT_ANGLES = Table(
    "joint_angles",
    2,
    "the joint's angles with the fitted hand",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        Column("joint", TEXT, "", "the joint, as the layout names it"),
        FRAME,
        Column(
            "flexion_deg", REAL, "deg", "flexion positive, extension negative (docs/joint-angles.md)", True
        ),
        Column(
            "abduction_deg", REAL, "deg", "abduction or deviation, signed as docs/joint-angles.md says", True
        ),
        Column("rotation_deg", REAL, "deg", "axial rotation, signed as docs/joint-angles.md says", True),
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "joint", "frame"),
)

BONE_POSES = Table(
    "bone_poses",
    2,
    "a bone of the fitted hand, posed with all receivers",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        Column("segment", TEXT, "", "the bone; those that carry no receiver among them"),
        FRAME,
        *_xyz(
            "", "mm", "centre of the bone's proximal joint (of the hand: the wrist) in the transmitter frame"
        ),
        *_quaternion("bone (x distal, z dorsal) to transmitter frame"),
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "segment", "frame"),
)

POSED_TIPS = Table(
    "posed_tips",
    2,
    "a tip of the fitted hand, posed with all receivers",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        MODEL,
        MADE_WITHOUT,
        DIGIT,
        FRAME,
        Column("time_s", REAL, "s", "device time as recorded", True),
        *_xyz("tip_", "mm", "end of the distal bone in the transmitter frame"),
        Column(
            "error_mm",
            REAL,
            "mm",
            "from where the hand says that the distal receiver is to where it is",
            True,
        ),
        Column(
            "error_left_out_mm",
            REAL,
            "mm",
            "the same with the positions of all distal receivers left out of the pose; null in frames that "
            "were not tried",
            True,
        ),
        Column("residual_mm", REAL, "mm", "rms distance of all receivers of the hand in this frame", True),
    ),
    ("subject", "hand", "task", "trial", "model", "made_without", "digit", "frame"),
)

CALIBRATED_ON = Column(
    "calibrated_on",
    TEXT,
    "",
    "tasks (and trials) that the skeleton was made from, joined by ';'; empty: none",
)

SKELETON_SCORES = Table(
    "skeleton_scores",
    1,
    "how well a skeleton does in one recording",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
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
        Column(
            "replay_mean_mm", REAL, "mm", "tip error of the receiver-driven replay, mean over frames", True
        ),
        Column("replay_p95_mm", REAL, "mm", "the same, 95th percentile", True),
        Column(
            "posed_mean_mm", REAL, "mm", "tip error of the fitted hand posed with all receivers, mean", True
        ),
        Column(
            "left_out_mean_mm",
            REAL,
            "mm",
            "the same with the distal receivers' positions left out, mean",
            True,
        ),
        Column("left_out_p95_mm", REAL, "mm", "the same, 95th percentile", True),
        Column(
            "wrist_mcp_sd_mm",
            REAL,
            "mm",
            "SD over the frames of the distance from the wrist to the digit's MCP joint",
            True,
        ),
        Column(
            "metacarpal_deg", REAL, "deg", "simulated: mean angle to the metacarpal's true direction", True
        ),
        Column(
            "true_tip_mean_mm",
            REAL,
            "mm",
            "simulated: mean distance to the true end of the distal bone",
            True,
        ),
        Column("true_tip_p95_mm", REAL, "mm", "the same, 95th percentile", True),
        Column("n_frames", WHOLE, "", "frames scored"),
        MESSAGE,
    ),
    ("subject", "hand", "task", "trial", "model", "calibrated_on", "digit"),
)

JOINT_ERRORS = Table(
    "joint_errors",
    1,
    "simulated hands only, how far a joint is from its truth",
    (
        SUBJECT,
        HAND,
        Column("model", TEXT, "", "the skeleton model, or the reference prior-only"),
        CALIBRATED_ON,
        Column("joint", TEXT, "", "the joint, as the layout names it"),
        Column(
            "error_mm",
            REAL,
            "mm",
            "distance of the centre to the true one, in the child receiver's frame",
            True,
        ),
        Column("along_mm", REAL, "mm", "its part along the true axis", True),
        Column("across_mm", REAL, "mm", "its part across the true axis", True),
        Column("parent_error_mm", REAL, "mm", "the distance in the parent receiver's frame", True),
        Column("axis_deg", REAL, "deg", "angle between the axis and the true one (hinges)", True),
        Column("sd_mm", REAL, "mm", "the stated 1-sigma error of the centre", True),
        Column("within_95", YES_NO, "", "whether the worse half is within the stated 95 % radius", True),
        Column("bone", TEXT, "", "the bone that starts at the joint; empty where its length is not stated"),
        Column("bone_error_mm", REAL, "mm", "its stated length minus the true one", True),
        Column("bone_error_percent", REAL, "%", "the same, of the true one", True),
    ),
    ("subject", "hand", "model", "calibrated_on", "joint"),
)

RECORDINGS = Table(
    "recordings",
    1,
    "recording of the study: what became of it",
    (
        SUBJECT,
        HAND,
        TASK,
        TRIAL,
        Column("role", TEXT, "", "calibration, evaluation or both"),
        Column("file", TEXT, "", "the recording's file, as in the sheet"),
        Column("status", TEXT, "", "used, excluded (by the sheet), refused (by a finding) or failed"),
        Column("n_frames", WHOLE, "", "frames of the recording"),
        Column("duration_s", REAL, "s", "from the first device time to the last", True),
        Column(
            "valid_percent",
            REAL,
            "%",
            "poses that may be used, of those that the layout expects in all frames, missing ones too",
            True,
        ),
        MESSAGE,
    ),
    ("subject", "hand", "task", "trial"),
)

PROBLEMS = Table(
    "problems",
    2,
    "a finding: anything that did not go as the study asked",
    (
        Column("subject", TEXT, "", "whose; empty: of the whole study"),
        Column("hand", TEXT, "", "right or left; empty: of no single hand"),
        Column("task", TEXT, "", "task, and trial, of the recording; empty: of no single one"),
        Column("model", TEXT, "", "the skeleton model; empty: of no single one"),
        Column("stage", TEXT, "", "the stage that met it"),
        Column(
            "kind", TEXT, "", "recording, hand, skeleton, receiver, correction or a kind of docs/mistakes.md"
        ),
        Column("severity", TEXT, "", "refused (no result), suspect or note"),
        MESSAGE,
    ),
    (),
)

TABLES = {
    table.name: table
    for table in (
        POSES,
        CAPTURE_RECORDS,
        FINDINGS,
        JOINT_SOLUTIONS,
        JOINT_CENTRES,
        METACARPALS,
        TIPS,
        TIP_ERRORS,
        BONE_LENGTHS,
        CALIBRATION_ADVICE,
        RECEIVERS,
        GAINS,
        JOINT_ANGLES,
        BONE_POSES,
        POSED_TIPS,
        SKELETON_SCORES,
        JOINT_ERRORS,
        RECORDINGS,
        PROBLEMS,
    )
}
