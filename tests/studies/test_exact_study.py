"""A study of hands that are true to rounding: joints that turn by 1e-14 deg end no report."""

from pathlib import Path

import pytest
from studies.running import write_study

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate

pytestmark = pytest.mark.slow


def test_hands_without_a_rounding_error_to_show(tmp_path: Path) -> None:
    rows = []
    for subject in ("01", "02"):
        file = tmp_path / f"{subject}.parquet"
        write_recording(file, simulate(subject, "right", "rom", 3, Realism.exact(), 600))
        rows.append(f"{subject}\tright\trom\tboth\t{file.name}")
    study = write_study(tmp_path, "exact", rows, ["paper-fig3-rest", "paper-fig3", "paper-fig4", "rigid"])
    study.run()
    assert "Not drawn" not in study.page()
