"""To add a thing it is enough to touch what docs/architecture.md says: each is added in a copy, and used."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from simulated_hands import FITTED, simulated_hand
from simulated_poses import write_poses
from studies.running import copy_of_the_program

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import simulate


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program, to which each test adds something."""
    return copy_of_the_program(tmp_path_factory.mktemp("program") / "copy")


@pytest.fixture(scope="module")
def poses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short recording's poses table."""
    made = simulate("01", "right", "rom", 7, Realism.exact(), 240)
    return write_poses(tmp_path_factory.mktemp("poses") / "poses.parquet", made, "right", "rom")


def run(program: Path, *words: str | Path) -> str:
    """Run a command of the copy; return what it prints."""
    done = subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=program,
        env=os.environ | {"PYTHONPATH": str(program)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def edit(path: Path, before: str, after: str) -> None:
    """Replace a text that stands in a file once."""
    text = path.read_text("utf-8")
    assert text.count(before) == 1, f"{path}: {before!r}"
    path.write_text(text.replace(before, after), "utf-8")


def test_a_model(program: Path, poses: Path, tmp_path: Path) -> None:
    models = program / "config" / "models"
    text = (models / "paper-fig4.yaml").read_text("utf-8")
    (models / "mine.yaml").write_text(text.replace("model: paper-fig4\n", "model: mine\n"), "utf-8")
    words = (
        "--poses",
        poses,
        "--layout",
        "liberty16",
        "--model",
        "mine",
        "--out",
        tmp_path / "joints.parquet",
    )
    run(program, program / "stages" / "solve_joints.py", *words)
    rows = pq.read_table(tmp_path / "joints.parquet")
    assert set(rows["model"].to_pylist()) == {"mine"}
    assert np.isfinite(rows["parent_x_mm"].drop_null().to_numpy()).any()


def test_a_column(program: Path, poses: Path, tmp_path: Path) -> None:
    schema = program / "schemas" / "tables" / "findings.yaml"
    version = int(schema.read_text("utf-8").split()[1])
    edit(schema, f"version: {version}", f"version: {version + 1}")
    with schema.open("a", encoding="utf-8") as file:
        file.write("  n_words:\n    type: int64\n    unit: words\n    meaning: how long the message is\n")
    edit(
        program / "stages" / "check_recordings.py",
        "**finding.accept(recording.accept).columns}",
        '**finding.accept(recording.accept).columns, "n_words": len(finding.message.split())}',
    )
    shifted = poses.with_name("metres.parquet")
    made = simulate("01", "right", "rom", 7, Realism.exact(), 240).poses()
    made.position_mm[:] /= 1000.0
    write_poses(shifted, made, "right", "rom")
    out = tmp_path / "findings.parquet"
    stage = program / "stages" / "check_recordings.py"
    run(program, stage, "--poses", shifted, "--layout", "liberty16", "--out", out)
    rows = pq.read_table(out)
    assert rows["n_words"].to_pylist() == [len(text.split()) for text in rows["message"].to_pylist()] != []
    assert rows.schema.field("n_words").metadata[b"unit"] == b"words"


def test_a_reader(program: Path, tmp_path: Path) -> None:
    formats = program / "shukotsu" / "readers" / "formats"
    (formats / "semicolons.py").write_text(
        "from shukotsu.readers.formats.tidy import read_csv\n\n\n"
        "def read_semicolons(path, layout, mapping):\n"
        '    commas = path.with_suffix(".csv")\n'
        '    commas.write_text(path.read_text().replace(";", ","))\n'
        "    return read_csv(commas, layout, mapping)\n"
    )
    line = '    "xdf": Format((".xdf", ".xdfz"), f"{_FORMATS}.xdf", "read_xdf"),\n'
    new = '    "semicolons": Format((".ssv",), f"{_FORMATS}.semicolons", "read_semicolons", in_parts=True),\n'
    text = (formats / "readers.py").read_text("utf-8")
    assert line in text
    (formats / "readers.py").write_text(text.replace(line, line + new, 1), "utf-8")
    rows = ["frame;time_s;segment;x_mm;y_mm;z_mm;qw;qx;qy;qz"]
    rows += [f"{i};{i / 240};{name};{i % 7};{k};0.5;1;0;0;0" for i in range(40) for k, name in
             enumerate(("hand", "index_proximal"))]  # fmt: skip
    (tmp_path / "rom.ssv").write_text("\n".join(rows) + "\n")
    who = ("--subject", "01", "--hand", "right", "--task", "rom", "--layout", "liberty16")
    out = tmp_path / "poses.parquet"
    run(program, "-m", "shukotsu", "import", "--in", tmp_path / "rom.ssv", "--out", out, *who)
    assert pq.read_table(out).num_rows >= 80


def test_an_export(program: Path, tmp_path: Path) -> None:
    export = program / "shukotsu" / "export"
    (export / "frame_list.py").write_text(
        '"""Frame numbers, a line each."""\n\n'
        "from shukotsu.tables.whole_files import write_text\n\n\n"
        "def write(motion, path):\n"
        '    write_text(path, "".join(f"{frame}\\n" for frame in motion.frame))\n'
        "    return ()\n"
    )
    edit(
        export / "formats.yaml",
        "formats:\n",
        "formats:\n  frames:\n    what: frame numbers\n    module: shukotsu.export.frame_list\n"
        '    extensions: [.frames]\n    up: ""\n    drops: all else\n',
    )
    hand = simulated_hand(tmp_path, "right")
    words = ("--plan", hand.plan_path, "--model", FITTED, "--formats", "frames", "--out", tmp_path / "out")
    run(program, program / "stages" / "export.py", *words)
    (written,) = (tmp_path / "out").glob("*.frames")
    assert list(map(int, written.read_text().split())) == hand.motion(FITTED).frame.tolist()
