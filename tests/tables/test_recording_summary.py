"""The summary of a recording from its poses table."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.study.findings import NOTE, REFUSED, Finding, finding_of_text
from shukotsu.study.recording_summary import recording_row
from shukotsu.study.study import Recording, Source
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import NUMBERS
from shukotsu.tables.subjects import Hand
from shukotsu.tables.typed_table import Provenance, write_failure, write_table_in_parts

RECORDING = Recording(Hand("01", "right"), "rom", "2", "both", Source(Path("a.csv"), "data/a.csv", Path("l")))
SEGMENTS = ("hand", "thumb", "index")
N_FRAMES = 40


def poses(path: Path, parameters: dict[str, Any], valid: Any = True, rows: int = N_FRAMES) -> Path:
    """Write a poses table; rows : rows per row group."""
    count, frame = N_FRAMES * len(SEGMENTS), np.tile(np.arange(N_FRAMES), len(SEGMENTS))
    columns = {
        "segment": np.repeat(SEGMENTS, N_FRAMES),
        "frame": frame,
        "time_s": frame / 240 + 3.0,
        **dict.fromkeys(NUMBERS, np.zeros(count)),
        "valid": np.broadcast_to(valid, count),
        "flags": np.full(count, ""),
    }
    starts = range(0, count, rows)
    groups = [{name: values[at : at + rows] for name, values in columns.items()} for at in starts]
    write_table_in_parts(path, POSES, groups, Provenance((), parameters))
    return path


def test_a_recording_without_problems_has_its_counts_and_no_finding(tmp_path: Path) -> None:
    row, problems = recording_row(RECORDING, poses(tmp_path / "p.parquet", {}))
    counts = {"n_frames": N_FRAMES, "n_receivers": len(SEGMENTS), "duration_s": pytest.approx(39 / 240)}
    words = {"role": "both", "file": "data/a.csv", "status": "used", "message": "", "tracker": ""}
    assert row == RECORDING.key | words | counts | {"valid_percent": 100.0}
    assert problems == []
    named, _ = recording_row(RECORDING, poses(tmp_path / "q.parquet", {"tracker": "VIPER"}))
    assert named["tracker"] == "VIPER"


GAPS = np.arange(N_FRAMES * len(SEGMENTS)) % 7 != 0


@pytest.mark.parametrize("rows", [9, 40, 120], ids=["parts-of-segments", "one-segment", "all"])
def test_gaps_and_missing_frames_reduce_the_valid_percentage(tmp_path: Path, rows: int) -> None:
    """Segments that the layout expects and the file lacks count as gaps; row groups make no difference."""
    path = poses(tmp_path / "p.parquet", {"missing_frames": 10, "absent": ["little"]}, GAPS, rows=rows)
    row, problems = recording_row(RECORDING, path)
    assert row["n_frames"] == N_FRAMES
    assert row["valid_percent"] == pytest.approx(100 * GAPS.sum() / (50 * 4))
    assert (row["message"], problems) == (
        Finding("recording", NOTE, "no-pose", {"segments": ["little"]}).message,
        [],
    )


def test_a_failed_or_excluded_recording_has_its_reason(tmp_path: Path) -> None:
    path = tmp_path / "p.parquet"
    write_failure(path, POSES, "a.csv: row 7: not a number", Provenance())
    row, problems = recording_row(RECORDING, path)
    assert (row["status"], row["message"], row["n_frames"]) == ("failed", problems[0].message, 0)
    assert problems == [finding_of_text("recording", REFUSED, "a.csv: row 7: not a number")]
    excluded = Recording(**{**vars(RECORDING), "exclude": "the cable came off"})
    row, problems = recording_row(excluded, tmp_path / "none.parquet")
    assert (row["status"], row["message"], problems) == ("excluded", "the cable came off", [])
