"""Joint angles of a recording: from rows to arrays and back, their ranges, and what a page packs of them."""

from __future__ import annotations

import math

import numpy as np
import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st

from stages.report.recording.angles import (
    ANGLE_STEP_DEG,
    ANGLES,
    JointAngles,
    angle_blocks,
    angle_ranges,
    joint_angles_of,
)
from stages.report.viewer.motion_data import packed, unpacked

DEGREES = st.none() | st.floats(-180, 180)
ROWS = st.dictionaries(
    st.tuples(st.sampled_from(["thumb_cmc", "index_mcp", "a <joint>"]), st.integers(0, 50)),
    st.tuples(DEGREES, DEGREES, DEGREES),
    min_size=1,
)


def table_of(rows: dict[tuple[str, int], tuple[float | None, ...]]) -> pa.Table:
    joints, frames = zip(*rows, strict=True)
    columns = {
        f"{name}_deg": pa.array(column, pa.float64())
        for name, column in zip(ANGLES, zip(*rows.values(), strict=True), strict=True)
    }
    return pa.table({"joint": pa.chunked_array([pa.array(joints)]), "frame": list(frames), **columns})


@given(ROWS)
def test_every_row_is_found_at_its_joint_and_frame(rows: dict[tuple[str, int], tuple[float, ...]]) -> None:
    angles = joint_angles_of("m", table_of(rows))
    assert angles is not None
    wanted = np.arange(51)
    found = angles.at(wanted)
    assert found.shape == (51, len(angles.joints), 3)
    for j, joint in enumerate(angles.joints):
        for frame in wanted:
            expected = [math.nan if v is None else v for v in rows.get((joint, int(frame)), (None,) * 3)]
            np.testing.assert_array_equal(found[frame, j], expected)


def test_no_row_is_no_angles() -> None:
    assert joint_angles_of("m", table_of({("x", 0): (1.0, 2.0, 3.0)}).slice(0, 0)) is None


@given(st.lists(st.floats(-180, 180), min_size=1, max_size=60), st.integers(0, 20))
def test_a_range_is_of_the_known_frames_alone(known: list[float], n_gaps: int) -> None:
    values = np.full((len(known) + n_gaps, 1, 3), np.nan)
    values[: len(known), 0, 1] = known
    (own,) = angle_ranges(JointAngles("m", ("j",), np.arange(len(values)), values))
    assert (own.joint, own.angle, own.n_frames) == ("j", "abduction", len(known))
    assert (own.at_deg[0], own.at_deg[-1]) == (min(known), max(known))
    np.testing.assert_allclose(own.at_deg[2], np.median(known), atol=1e-9)
    np.testing.assert_allclose(own.at_deg[1::2], np.quantile(known, [0.05, 0.95]), atol=1e-9)


@given(st.lists(st.floats(-180, 180) | st.just(math.nan), min_size=3, max_size=40))
def test_a_packed_angle_prints_as_the_tables_own_to_a_tenth(values: list[float]) -> None:
    angle = np.array(values)[:, None, None] * [1.0, 0.5, -1.0]
    frame = np.arange(len(values))
    (block,) = angle_blocks([JointAngles("m", ("j",), frame, angle)], frame)
    assert (block.name, block.step) == ("angles0", ANGLE_STEP_DEG)
    read = unpacked(*packed([block]))["angles0"]
    known = np.isfinite(angle).all(-1)
    np.testing.assert_array_equal(np.isfinite(read).all(-1), known)
    for shown, exact in zip(read[known].ravel(), angle[known].ravel(), strict=True):
        if abs(exact * 10 % 1 - 0.5) > 1e-6:  # a tie may go either way
            assert f"{shown + 0.0:.1f}".replace("-0.0", "0.0") == f"{exact:.1f}".replace("-0.0", "0.0")
