"""What a recording's figures show: gaps stay gaps, peaks stay, joints stand where the report puts them."""

import numpy as np
import pytest
from report_samples.hand_tables import part_of, write_parts
from report_samples.read_page import rows_where

from shukotsu.errors import InputError
from shukotsu.schemas.catalogue import JOINT_ANGLES, TIPS
from shukotsu.schemas.study import Recording
from shukotsu.schemas.tables import read_table
from shukotsu.stages.report.palette import MODELS
from shukotsu.stages.report.print_figures.recording_figures import (
    find_recording,
    joint_angles,
    thin,
    tip_error,
)
from shukotsu.stages.report.study_results import StudyResults


@pytest.fixture(scope="module")
def recording(results: StudyResults) -> Recording:
    return find_recording(results, "S01", "right", "opposition")


def test_a_peak_and_a_gap_survive_thinning() -> None:
    time_s, error = np.arange(100_000) / 240, np.ones(100_000)
    error[54_321], error[60_000:70_000] = 77.0, np.nan
    trace = thin(time_s, error, 200)
    assert trace is not None
    assert abs(trace.x[np.nanargmax(trace.high)] - time_s[54_321]) <= time_s[-1] / 200
    assert (np.nanmin(trace.low), np.nanmax(trace.high)) == (1.0, 77.0)
    assert np.isnan(trace.high).sum() == np.isnan(trace.low).sum() == 1
    inside = (trace.x > time_s[60_500]) & (trace.x < time_s[69_500])
    assert not np.isfinite(trace.high[inside]).any()


@pytest.mark.parametrize(("n", "breaks"), [(50, 1), (5000, 0)])
def test_a_missing_frame_breaks_a_line_of_few_frames(n: int, breaks: int) -> None:
    error = np.ones(n)
    error[20] = np.nan
    trace = thin(np.arange(n, dtype=float), error, 240)
    assert trace is not None
    assert np.isnan(trace.high).sum() == breaks


def test_tip_errors_are_the_tables_and_break_at_the_gap(results: StudyResults, recording: Recording) -> None:
    figure, caption = tip_error(results, recording)
    line = next(line for line in figure.axes[1].lines if line.get_color() == MODELS[2])
    data = read_table(results.paths.study_table("tips"), TIPS).to_pylist()
    rows = rows_where(data, subject="S01", hand="right", model="paper-fig4", digit="index")
    largest = max(row["error_mm"] for row in rows if row["error_mm"] is not None)
    assert np.nanmax(line.get_ydata()) == largest
    assert np.isnan(line.get_ydata()).sum() == 1
    assert "n = 240–300 frames" in caption
    assert "least-squares" in caption
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "", "", "Device time [s]"]


def test_joint_angles_are_the_tables(simulated: StudyResults) -> None:
    recording = find_recording(simulated, "S0", "left", "opposition")
    path = simulated.fit_table(recording.hand, "whole-hand", "joint_angles")
    key = {"subject": "S0", "hand": "left", "task": "opposition", "trial": "", "model": "whole-hand"}
    rows = [
        {**key, "joint": joint, "frame": frame,
         "flexion_deg": 3.0 * frame, "abduction_deg": -1.0, "rotation_deg": 0.5}
        for joint in ("wrist", "ring_cmc", "ring_mcp", "index_pip")
        for frame in range(12)
    ]  # fmt: skip
    write_parts(path, JOINT_ANGLES, {part_of(recording.hand, "whole-hand"): rows})
    try:
        figure, caption = joint_angles(simulated, recording, "whole-hand")
    finally:
        path.unlink()
    assert [axes.get_title("right") for axes in figure.axes] == ["index_pip", "ring_cmc", "ring_mcp", "wrist"]
    flexion = figure.axes[0].lines[1]
    np.testing.assert_allclose(np.unique(flexion.get_ydata()), 3.0 * np.arange(12))
    assert np.isclose(np.asarray(flexion.get_xdata())[-1], 11 / 240, atol=0.6 / 240)
    assert "n = 12 frames" in caption


def test_a_recording_is_found_by_its_name_or_its_path(results: StudyResults) -> None:
    hostile = 'A & <b>"x"'
    recording = find_recording(results, hostile, "right", "opposition")
    assert recording.hand.subject == hostile
    assert find_recording(results, recording.hand.who.token, "right", "opposition") == recording
    with pytest.raises(InputError, match="S01 right rom: no such recording; this hand has opposition"):
        find_recording(results, "S01", "right", "rom")
    with pytest.raises(InputError, match="hands are S01 right, S01 left"):
        find_recording(results, "S02", "right", "rom")
