"""Files that would need excessive time or memory, and pipes, are refused by import and inspect."""

import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from recording_files import WHO

from shukotsu.__main__ import main
from shukotsu.errors import MOST_LETTERS
from shukotsu.study.file_formats import FORMATS
from shukotsu.tables import limits

HEADER = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROW = "0,0,hand,1,2,3,1,0,0,0\n"


def outcomes(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[list[int], list[str]]:
    poses = path.with_name("poses.parquet")
    codes = [main(["import", f"--in={path}", *WHO, f"--out={poses}"]), main(["inspect", str(path)])]
    lines = capsys.readouterr().err.splitlines()
    assert all(len(line) <= MOST_LETTERS + len("error: ") for line in lines)
    assert not poses.exists()
    return codes, lines


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.xlsx", "PK\x03\x04...", "is a spreadsheet or another packed file"),
        ("a.csv", f"{HEADER}{'1' * 5000}{ROW}", "line 2, column frame: is '111111111"),
        ("a.arrows", "", "is empty"),
        ("a.csv", "a" * 140_000 + f",{HEADER}{ROW}", ""),
        ("a.csv", f"{HEADER}0,0,{'h' * 140_000},1,2,3,1,0,0,0\n", ""),
        ("a.csv", "a" * 2_000_000, ""),
        ("a.csv", "\0" * 2_000_000, ""),
    ],
    ids=["spreadsheet", "number", "empty", "header", "cell", "line", "zeros"],
)
def test_an_excessive_file_is_refused_in_one_short_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: str, message: str
) -> None:
    (tmp_path / name).write_text(content)
    (code, other), lines = outcomes(tmp_path / name, capsys)
    assert code == 2
    assert other == 2 or not message
    assert all(message in line for line in lines)


@pytest.mark.parametrize("ending", [form.endings[0] for form in FORMATS.values()] + [".c3d", ".txt"])
def test_a_pipe_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    path = tmp_path / f"sub-1_task-rom{ending}"
    os.mkfifo(path)
    codes, lines = outcomes(path, capsys)
    assert codes == [2, 2]
    assert all("is a pipe; expected" in line for line in lines)


def test_a_table_that_expands_beyond_memory_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MEMORY_BYTES", 10**7)
    rows = 600_000
    columns = {name: np.zeros(rows) for name in HEADER.strip().split(",") if name not in ("frame", "segment")}
    whole = {"frame": np.zeros(rows, int), "segment": pa.repeat(pa.scalar("hand"), rows), **columns}
    pq.write_table(pa.table(whole), tmp_path / "a.parquet", compression="zstd")
    codes, lines = outcomes(tmp_path / "a.parquet", capsys)
    assert codes == [2, 2]
    assert all("MB to 0.0 GB, which no recording does; copy it again" in line for line in lines)
