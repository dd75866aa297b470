"""Reading recordings in small blocks gives the same results as reading them whole."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import stage_runs
from small_study import PlannedSubject, planned_subject, run_stages
from stage_runs import of_plan, outputs

from shukotsu.checks import checked_recording, timeline
from shukotsu.hand import posed_recording, recorded_movement
from shukotsu.readers import jumps
from shukotsu.tables import poses

FEW = 37


def tables(subject: PlannedSubject, out: Path) -> dict[str, pa.Table]:
    run_stages(subject.plan_file)
    for stage in ("check_recordings", "measure_movement"):
        argv = [*of_plan(stage, subject.plan_file), *outputs(stage, out)]
        assert getattr(stage_runs, stage)(argv) == 0
    files = [*subject.plan_file.parent.glob("*.parquet"), *out.glob("*.parquet")]
    return {file.name: pq.read_table(file) for file in files}


@pytest.mark.slow
def test_results_do_not_depend_on_the_size_of_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subject = planned_subject(tmp_path, [("right", "rom", "both")], ["paper-fig4"], n_frames=90)
    out = tmp_path / "out"
    whole = tables(subject, out)
    monkeypatch.setattr(poses, "KEPT_BYTES", 0)
    monkeypatch.setattr(poses.pose_blocks, "__defaults__", (FEW,))
    for module in (posed_recording, recorded_movement):
        monkeypatch.setattr(module, "BLOCK_FRAMES", FEW)
    for module in (checked_recording, timeline):
        monkeypatch.setattr(module, "BLOCK_ROWS", FEW)
    monkeypatch.setattr(jumps, "_BLOCK_ROWS", FEW)
    in_blocks = tables(subject, out)
    assert in_blocks.keys() == whole.keys()
    for name, table in whole.items():
        assert in_blocks[name].equals(table), name
    assert pq.ParquetFile(subject.plan_file.parent / "tips.parquet").num_row_groups > len(whole)
