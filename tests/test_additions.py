"""To add a thing it is enough to touch what docs/architecture.md says: each is added in a copy, and used."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from simulated_hands import FITTED, SimulatedHand, simulated_hand
from simulated_poses import write_poses
from studies.running import copy_of_the_program

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import simulate

RUN = "import json, sys; from shukotsu.__main__ import main; sys.exit(any(map(main, json.load(sys.stdin))))"


def edit(path: Path, before: str, after: str) -> None:
    """Replace a text that stands in a file once."""
    text = path.read_text("utf-8")
    assert text.count(before) == 1, f"{path}: {before!r}"
    path.write_text(text.replace(before, after), "utf-8")


def add_model(program: Path) -> None:
    models = program / "config" / "models"
    text = (models / "paper-fig4.yaml").read_text("utf-8")
    (models / "mine.yaml").write_text(text.replace("model: paper-fig4\n", "model: mine\n"), "utf-8")


def add_column(program: Path) -> None:
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


def add_reader(program: Path) -> None:
    formats = program / "shukotsu" / "readers" / "formats"
    (formats / "semicolons.py").write_text(
        "from shukotsu.readers.formats.tidy import read_csv\n\n\n"
        "def read_semicolons(path, layout, mapping):\n"
        '    commas = path.with_suffix(".csv")\n'
        '    commas.write_text(path.read_text().replace(";", ","))\n'
        "    return read_csv(commas, layout, mapping)\n"
    )
    line = '    "sequence": FileFormat((".mha", ".nrrd"), "sequence", "read_sequence"),\n'
    new = '    "semicolons": FileFormat((".ssv",), "semicolons", "read_semicolons", in_parts=True),'
    edit(program / "shukotsu" / "study" / "file_formats.py", line, f"{line}{new}\n")


def add_export(program: Path) -> None:
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


@pytest.fixture(scope="module")
def hand(tmp_path_factory: pytest.TempPathFactory) -> SimulatedHand:
    return simulated_hand(tmp_path_factory.mktemp("hand"), "right", 20)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, hand: SimulatedHand) -> Path:
    """What commands of a copy with all additions write, all in one process, which starts but once."""
    folder = tmp_path_factory.mktemp("added")
    program = copy_of_the_program(folder / "program")
    for add in (add_model, add_column, add_reader, add_export):
        add(program)
    poses = simulate("01", "right", "rom", 7, Realism.exact(), 240).poses()
    in_metres = replace(poses, position_mm=poses.position_mm / 1000)
    write_poses(folder / "poses.parquet", poses, "right", "rom")
    write_poses(folder / "metres.parquet", in_metres, "right", "rom")
    rows = [f"{i};{i / 240};{name};{i % 7};{k};0.5;1;0;0;0" for i in range(40)
            for k, name in enumerate(("hand", "index_proximal"))]  # fmt: skip
    (folder / "rom.ssv").write_text("\n".join(["frame;time_s;segment;x_mm;y_mm;z_mm;qw;qx;qy;qz", *rows, ""]))
    commands = (
        "stage solve_joints --poses poses.parquet --layout liberty16 --model mine --out joints.parquet",
        "stage check_recordings --poses metres.parquet --layout liberty16 --out findings.parquet",
        "import --in rom.ssv --out read.parquet --subject 01 --hand right --task rom --layout liberty16",
        f"stage export --plan {hand.plan_path} --model {FITTED} --formats frames --out exports",
    )
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        input=json.dumps([command.split() for command in commands]),
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(program)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_an_added_model_solves_joints(folder: Path) -> None:
    rows = pq.read_table(folder / "joints.parquet")
    assert set(rows["model"].to_pylist()) == {"mine"}
    assert np.isfinite(rows["parent_x_mm"].drop_null().to_numpy()).any()


def test_an_added_column_is_written_with_its_unit(folder: Path) -> None:
    rows = pq.read_table(folder / "findings.parquet")
    assert rows["n_words"].to_pylist() == [len(text.split()) for text in rows["message"].to_pylist()] != []
    assert rows.schema.field("n_words").metadata[b"unit"] == b"words"


def test_an_added_reader_imports_its_format(folder: Path) -> None:
    assert pq.read_table(folder / "read.parquet").num_rows >= 80


def test_an_added_format_is_exported(folder: Path, hand: SimulatedHand) -> None:
    (written,) = (folder / "exports").glob("*.frames")
    assert list(map(int, written.read_text().split())) == hand.motion(FITTED).frame.tolist()
