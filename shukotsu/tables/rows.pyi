"""Types of the rows of tables, for the type checker alone: a key a column.

No key is required: rows are put together in steps, and writers add the keys of a part. Tables with
a row a frame are columns, never rows. Made by `make docs` from schemas/tables: change those.
"""

from typing import Any, TypeAlias, TypedDict

MaybeNone: TypeAlias = Any
"""Null; a reader knows from other columns, such as the status, that it is not."""

class AgreementRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    bone: str
    across: str
    first: str
    second: str
    difference_mm: float
    sd_mm: float
    z: float

class BoneLengthsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    digit: str
    bone: str
    starts_at: str
    ends_at: str
    length_mm: float | MaybeNone
    sd_mm: float | MaybeNone
    x_mm: float | MaybeNone
    y_mm: float | MaybeNone
    z_mm: float | MaybeNone
    driven_by: str
    sd_over_frames_mm: float | MaybeNone
    verdict: str
    reason: str
    reason_values: str
    message: str

class ClocksRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    source: str
    scale_ppm: float | MaybeNone
    offset_s: float | MaybeNone
    residual_ms: float | MaybeNone
    clock_sd_ms: float | MaybeNone
    n_pulses: int
    n_missing: int
    n_extra: int
    status: str
    message: str

class CycleCurvesRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    event: str
    joint: str
    angle: str
    cycle_percent: int
    mean_deg: float | MaybeNone
    sd_deg: float | MaybeNone
    n_cycles: int

class EventStrokesRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    event: int
    name: str
    digit: str
    onset_s: float | MaybeNone
    onset_sd_ms: float | MaybeNone
    key_down_s: float | MaybeNone
    key_down_sd_ms: float | MaybeNone
    contact_speed_mm_s: float | MaybeNone
    contact_speed_sd_mm_s: float | MaybeNone
    peak_speed_before_mm_s: float | MaybeNone
    peak_speed_sd_mm_s: float | MaybeNone
    used: bool
    status: str
    message: str

class EventsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    event: int
    name: str
    onset_s: float | MaybeNone
    duration_s: float | MaybeNone
    value: float | MaybeNone
    channel: int | MaybeNone
    source: str
    onset_sd_ms: float | MaybeNone

class FindingsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    kind: str
    severity: str
    variant: str
    values: str
    accepted: str
    message: str

class FingertipPathsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    digit: str
    path_length_mm: float | MaybeNone
    duration_s: float | MaybeNone
    speed_median_mm_s: float | MaybeNone
    speed_p95_mm_s: float | MaybeNone
    path_sd_mm: float | MaybeNone
    n_frames: int
    valid_percent: float | MaybeNone
    status: str
    message: str

class GainsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    quantity: str
    sd_mm: float
    mean_sd_before_mm: float
    mean_sd_after_mm: float
    joint: str
    joint_sd_before_mm: float
    joint_sd_after_mm: float

class JointCentresRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    joint: str
    parent_segment: str
    child_segment: str
    dof: int
    parent_x_mm: float | MaybeNone
    parent_y_mm: float | MaybeNone
    parent_z_mm: float | MaybeNone
    child_x_mm: float | MaybeNone
    child_y_mm: float | MaybeNone
    child_z_mm: float | MaybeNone
    axis_parent_x: float | MaybeNone
    axis_parent_y: float | MaybeNone
    axis_parent_z: float | MaybeNone
    axis_child_x: float | MaybeNone
    axis_child_y: float | MaybeNone
    axis_child_z: float | MaybeNone
    sd_mm: float | MaybeNone
    scatter_sd_mm: float | MaybeNone
    covariance_mm2: list[float] | MaybeNone
    gap_rms_mm: float | MaybeNone
    gap_rms_free_mm: float | MaybeNone
    range_deg: float | MaybeNone
    axis_sd_deg: float | MaybeNone
    rest_flexion_deg: float | MaybeNone
    rest_abduction_deg: float | MaybeNone
    rest_rotation_deg: float | MaybeNone
    axes_turn_deg: float | MaybeNone
    axes_turn_sd_deg: float | MaybeNone
    axis_plane_deg: float | MaybeNone
    slide_mm: float | MaybeNone
    correction_mm: float | MaybeNone
    n_frames: int
    n_effective: float | MaybeNone
    source: str
    verdict: str
    reason: str
    reason_values: str
    status: str
    message: str

class JointErrorsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    calibrated_on: str
    joint: str
    error_mm: float | MaybeNone
    along_mm: float | MaybeNone
    across_mm: float | MaybeNone
    parent_error_mm: float | MaybeNone
    axis_deg: float | MaybeNone
    sd_mm: float | MaybeNone
    within_95: bool | MaybeNone
    parent_within_95: bool | MaybeNone
    bone: str
    bone_error_mm: float | MaybeNone
    bone_error_percent: float | MaybeNone

class JointSolutionsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    joint: str
    parent_segment: str
    child_segment: str
    parent_x_mm: float | MaybeNone
    parent_y_mm: float | MaybeNone
    parent_z_mm: float | MaybeNone
    child_x_mm: float | MaybeNone
    child_y_mm: float | MaybeNone
    child_z_mm: float | MaybeNone
    null_parent_x: float | MaybeNone
    null_parent_y: float | MaybeNone
    null_parent_z: float | MaybeNone
    null_child_x: float | MaybeNone
    null_child_y: float | MaybeNone
    null_child_z: float | MaybeNone
    mean_rotation_xx: float | MaybeNone
    mean_rotation_xy: float | MaybeNone
    mean_rotation_xz: float | MaybeNone
    mean_rotation_yx: float | MaybeNone
    mean_rotation_yy: float | MaybeNone
    mean_rotation_yz: float | MaybeNone
    mean_rotation_zx: float | MaybeNone
    mean_rotation_zy: float | MaybeNone
    mean_rotation_zz: float | MaybeNone
    singular_values: list[float] | MaybeNone
    covariance_mm2: list[float] | MaybeNone
    gap_rms_mm: float | MaybeNone
    gap_rms_free_mm: float | MaybeNone
    slide_to_free_mm: float | MaybeNone
    range_deg: float | MaybeNone
    spread_deg: float | MaybeNone
    axis_sd_deg: float | MaybeNone
    n_frames: int
    n_effective: float | MaybeNone
    reason_values: str
    status: str
    message: str

class LengthPullsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    bone: str
    unknown: str
    group: str
    pull_mm: float
    alone_mm: float
    alone_sd_mm: float

class ModelDifferencesRow(TypedDict, total=False):
    metric: str
    table: str
    unit: str
    held_out: bool
    digit: str
    model: str
    other: str
    baseline: bool
    n_subjects: int
    n_compared_subjects: int
    mean: float | MaybeNone
    other_mean: float | MaybeNone
    mean_difference: float | MaybeNone
    median_difference: float | MaybeNone
    interval_95_low: float | MaybeNone
    interval_95_high: float | MaybeNone
    p: float | MaybeNone
    p_holm: float | MaybeNone
    smallest_p: float | MaybeNone
    smallest_p_holm: float | MaybeNone
    n_comparisons: int
    effect_size: float | MaybeNone
    n_better: int | MaybeNone
    n_equal: int | MaybeNone

class ModelPairsRow(TypedDict, total=False):
    metric: str
    digit: str
    subject: str
    model: str
    other: str
    unit: str
    value: float | MaybeNone
    other_value: float | MaybeNone
    difference: float | MaybeNone
    n_places: int

class ModelValuesRow(TypedDict, total=False):
    metric: str
    digit: str
    subject: str
    model: str
    reference: bool
    held_out: bool
    unit: str
    value: float | MaybeNone
    n_places: int
    missing: str

class MovedReceiversRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    made_without: str
    segment: str
    from_frame: int
    from_s: float | MaybeNone
    shift_mm: float
    turn_deg: float
    joints: str
    digits: str

class MovementCyclesRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    event: str
    cycle: int
    onset_s: float | MaybeNone
    duration_s: float | MaybeNone
    used: bool
    message: str

class MovementDifferencesRow(TypedDict, total=False):
    factor: str
    level: str
    other_level: str
    hand: str
    task: str
    model: str
    quantity: str
    of: str
    design: str
    n: int
    n_other: int
    left_out: int
    left_out_reason: str
    mean: float | MaybeNone
    other_mean: float | MaybeNone
    sd: float | MaybeNone
    other_sd: float | MaybeNone
    difference: float | MaybeNone
    low: float | MaybeNone
    high: float | MaybeNone
    effect_size: float | MaybeNone
    effect_low: float | MaybeNone
    effect_high: float | MaybeNone
    effect_size_name: str
    p: float | MaybeNone
    p_holm: float | MaybeNone
    verdict: str
    test: str
    unit: str
    message: str

class MovementReliabilityRow(TypedDict, total=False):
    across: str
    hand: str
    task: str
    model: str
    quantity: str
    of: str
    n: int
    k: int
    contains: str
    left_out: int
    left_out_reason: str
    icc_2_1: float | MaybeNone
    icc_2_1_low: float | MaybeNone
    icc_2_1_high: float | MaybeNone
    icc_3_1: float | MaybeNone
    icc_3_1_low: float | MaybeNone
    icc_3_1_high: float | MaybeNone
    sem: float | MaybeNone
    sem_low: float | MaybeNone
    sem_high: float | MaybeNone
    mdc: float | MaybeNone
    unit: str
    message: str

class ProblemsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    model: str
    stage: str
    kind: str
    severity: str
    variant: str
    values: str
    accepted: str
    message: str

class RangesOfMotionRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    joint: str
    angle: str
    range_deg: float | MaybeNone
    low_deg: float | MaybeNone
    high_deg: float | MaybeNone
    full_range_deg: float | MaybeNone
    median_deg: float | MaybeNone
    range_sd_deg: float | MaybeNone
    median_sd_deg: float | MaybeNone
    range_session_sd_deg: float | MaybeNone
    median_session_sd_deg: float | MaybeNone
    speed_median_deg_s: float | MaybeNone
    speed_p95_deg_s: float | MaybeNone
    n_frames: int
    valid_percent: float | MaybeNone
    status: str
    message: str

class ReceiversRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    model: str
    made_without: str
    segment: str
    along_mm: float | MaybeNone
    along_sd_mm: float | MaybeNone
    lateral_mm: float | MaybeNone
    lateral_sd_mm: float | MaybeNone
    height_mm: float | MaybeNone
    height_sd_mm: float | MaybeNone
    bone_tip_x_mm: float | MaybeNone
    bone_tip_y_mm: float | MaybeNone
    bone_tip_z_mm: float | MaybeNone
    bone_tip_sd_mm: float | MaybeNone
    soft_tip_x_mm: float | MaybeNone
    soft_tip_y_mm: float | MaybeNone
    soft_tip_z_mm: float | MaybeNone
    soft_tip_sd_mm: float | MaybeNone
    residual_mm: float | MaybeNone
    residual_deg: float | MaybeNone
    loose_kind: str
    loose_from_frame: int | MaybeNone
    loose_until_frame: int | MaybeNone
    loose_task: str
    loose_shift_mm: float | MaybeNone
    loose_turn_deg: float | MaybeNone
    field_x_mm: float | MaybeNone
    field_y_mm: float | MaybeNone
    field_z_mm: float | MaybeNone
    left_out_share: float | MaybeNone
    status: str
    message: str

class RecordingsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    role: str
    file: str
    status: str
    tracker: str | MaybeNone
    n_frames: int
    n_receivers: int
    duration_s: float | MaybeNone
    valid_percent: float | MaybeNone
    message: str

class SkeletonScoresRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    calibrated_on: str
    held_out: bool
    reference: bool
    digit: str
    replay_mean_mm: float | MaybeNone
    replay_p95_mm: float | MaybeNone
    posed_mean_mm: float | MaybeNone
    left_out_mean_mm: float | MaybeNone
    left_out_p95_mm: float | MaybeNone
    wrist_mcp_sd_mm: float | MaybeNone
    metacarpal_deg: float | MaybeNone
    true_tip_mean_mm: float | MaybeNone
    true_tip_p95_mm: float | MaybeNone
    n_frames: int
    message: str

class TipErrorsRow(TypedDict, total=False):
    subject: str
    session: str
    hand: str
    task: str
    trial: str
    model: str
    made_without: str
    digit: str
    binding: str
    max_mm: float | MaybeNone
    min_mm: float | MaybeNone
    mean_mm: float | MaybeNone
    sd_mm: float | MaybeNone
    median_mm: float | MaybeNone
    p95_mm: float | MaybeNone
    n_frames: int
    n_frames_total: int
    held_out: bool
    message: str
