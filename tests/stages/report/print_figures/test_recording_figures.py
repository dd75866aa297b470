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
from shukotsu.stages.report.print_figures.over_time import joint_angles, tip_error
from shukotsu.stages.report.print_figures.skeletons import skeletons
from shukotsu.stages.report.print_figures.study_figures import find_recording
from shukotsu.stages.report.study_results import StudyResults


@pytest.fixture(scope="module")
def recording(results: StudyResults) -> Recording:
    return find_recording(results, "S01", "right", "opposition")


def test_tip_errors_are_the_tables_and_break_at_the_gap(results: StudyResults, recording: Recording) -> None:
    figure, caption = tip_error(results, recording)
    line = next(line for line in figure.axes[1].lines if line.get_color() == MODELS[2])
    data = read_table(results.paths.study_table("tips"), TIPS).to_pylist()
    own = rows_where(data, subject="S01", hand="right", model="paper-fig4", digit="index")
    largest = max(row["error_mm"] for row in own if row["error_mm"] is not None)
    assert np.nanmax(line.get_ydata()) == largest
    assert np.isnan(line.get_ydata()).sum() == 1
    assert "n = 240–300 frames" in caption
    assert "least-squares" in caption
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", "", "", "Device time [s]"]


def test_skeletons_show_every_joint_and_name_what_they_cannot(results: StudyResults) -> None:
    """The little DIP joint is doubtful and far off, the ring DIP joint has no place, where not corrected."""
    spoiled = find_recording(results, "S01", "left", "opposition")
    figure, caption = skeletons(results, spoiled)
    assert len(figure.axes) == 3
    assert (
        "(a) paper-fig3-rest and paper-fig3; not to be believed: little_dip; outside the picture: " in caption
    )
    assert "(b) paper-fig4 and rigid; not to be believed: little_dip; outside" in caption
    assert "(c) paper-fig4-corrected; not to be believed: little_dip; without a place: ring_dip." in caption


def test_joint_angles_are_the_tables(simulated: StudyResults) -> None:
    recording = find_recording(simulated, "S0", "left", "opposition")
    path = simulated.fit_table(recording.hand, "whole-hand", "joint_angles")
    key = {"subject": "S0", "hand": "left", "task": "opposition", "trial": "", "model": "whole-hand"}
    rows = [
        {
            **key,
            "joint": joint,
            "frame": frame,
            "flexion_deg": 3.0 * frame,
            "abduction_deg": -1.0,
            "rotation_deg": 0.5,
        }
        for joint in ("wrist", "ring_cmc", "ring_mcp", "index_pip")
        for frame in range(12)
    ]
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
    found = find_recording(results, hostile, "right", "opposition")
    assert found.hand.subject == hostile
    assert find_recording(results, found.hand.folder[4:].split("/")[0], "right", "opposition") == found
    with pytest.raises(InputError, match="S01 right rom: no such recording; this hand has opposition"):
        find_recording(results, "S01", "right", "rom")
    with pytest.raises(InputError, match="hands are S01 right, S01 left"):
        find_recording(results, "S02", "right", "rom")
