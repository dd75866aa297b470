"""Files that are small and ask for much, or are none: import and inspect refuse each by a sentence."""

import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shukotsu.__main__ import main
from shukotsu.errors import MOST_LETTERS
from shukotsu.readers.formats.readers import FORMATS

HEADER = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
ROW = "0,0,hand,1,2,3,1,0,0,0\n"


def refusals(path: Path, capsys: pytest.CaptureFixture[str], folder: Path) -> list[str]:
    """Import and inspect a file; give the sentences in which both refuse it."""
    recording = ["--layout=liberty16", "--subject=1", "--hand=right", "--task=rom"]
    for command in (
        ["import", f"--in={path}", *recording, f"--out={folder / 'poses.parquet'}"],
        ["inspect", str(path)],
    ):
        assert main(command) == 2
    lines = capsys.readouterr().err.splitlines()
    assert all(len(line) <= MOST_LETTERS + len("error: ") for line in lines)
    assert not list(folder.glob("poses.parquet"))
    return lines


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"%PDF-1.7\n%\xe2\xe3", "is a PDF document; expected a recording: save it as text"),
        ("a.csv", b"PK\x03\x04...", "is a spreadsheet or another packed file"),
        ("a.xlsx", b"PK\x03\x04...", "is a spreadsheet or another packed file"),
        ("a.csv", HEADER.encode("utf-16"), "is UTF-16 text; expected a recording: save it as UTF-8"),
        ("a.csv", f"{HEADER}{'1' * 5000}{ROW}".encode(), "line 2, column frame: is '111111111"),
        ("a.arrows", b"", "is empty"),
    ],
)
def test_other_kinds_of_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    for line in refusals(tmp_path / name, capsys, tmp_path):
        assert message in line


@pytest.mark.parametrize(
    "content",
    [
        "a" * 140_000 + f",{HEADER}{ROW}",
        f"{HEADER}0,0,{'h' * 140_000},1,2,3,1,0,0,0\n",
        "a" * 2_000_000,
        "\0" * 2_000_000,
    ],
    ids=["header", "cell", "line", "zeros"],
)
def test_long_cells_and_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(content)
    recording = ["--layout=liberty16", "--subject=1", "--hand=right", "--task=rom"]
    assert main(["import", f"--in={path}", *recording, f"--out={tmp_path / 'poses.parquet'}"]) == 2
    assert main(["inspect", str(path)]) in (0, 2)
    assert all(len(line) <= MOST_LETTERS + len("error: ") for line in capsys.readouterr().err.splitlines())


@pytest.mark.parametrize("ending", [form.endings[0] for form in FORMATS.values()] + [".c3d", ".txt"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    path = tmp_path / f"sub-1_task-rom{ending}"
    os.mkfifo(path)
    for line in refusals(path, capsys, tmp_path):
        assert "is a pipe; expected" in line


def test_a_device_never_ends(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").symlink_to("/dev/zero")
    for line in refusals(tmp_path / "a.csv", capsys, tmp_path):
        assert "is a device; expected a recording, a regular file" in line


def test_a_table_of_nothing_but_repetition(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Some hundred kilobytes, from which 350 MB and more would come."""
    rows = 4_500_000
    columns = {name: np.zeros(rows) for name in HEADER.strip().split(",") if name not in ("frame", "segment")}
    whole = {"frame": np.zeros(rows, int), "segment": pa.repeat(pa.scalar("hand"), rows), **columns}
    pq.write_table(pa.table(whole), tmp_path / "a.parquet", compression="zstd")
    assert (tmp_path / "a.parquet").stat().st_size < 10**6
    for line in refusals(tmp_path / "a.parquet", capsys, tmp_path):
        assert "MB to 0.4 GB, which no recording does; copy it again" in line
