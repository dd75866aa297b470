"""The edits that docs/architecture.md names suffice to add a feature: each is made in a copy and used."""

import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from guide_pages import REPOSITORY, anchors, blocks
from program_files import printed_by
from simulated_hands import FITTED, SimulatedHand, simulated_hand
from simulated_poses import write_poses
from small_study import write_study
from studies.running import copy_of_the_program

from shukotsu.simulate.realism import Realism
from shukotsu.simulate.simulation import simulate
from shukotsu.study.config_files import read_constants
from shukotsu.tables.poses import RecordingName

pytestmark = pytest.mark.slow

RUN = "import json, sys; from shukotsu.__main__ import main; sys.exit(any(map(main, json.load(sys.stdin))))"


def edit(path: Path, before: str, after: str) -> None:
    """Replace a text that occurs once in a file."""
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
        "**finding.columns})",
        '**finding.columns, "n_words": len(finding.message.split())})',
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
    options = "'semicolons.read_semicolons', 'semicolons', inspector='text_tables.describe_table'"
    new = f'"semicolons": FileFormat((".ssv",), {options}),'
    edit(program / "shukotsu" / "study" / "file_formats.py", "FORMATS = {\n", f"FORMATS = {{\n{new}\n")


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
    """Folder of the results of a copy with all additions; its commands run in one process to save time."""
    folder = tmp_path_factory.mktemp("added")
    program = copy_of_the_program(folder / "program")
    for add in (add_model, add_column, add_reader, add_export):
        add(program)
    poses = simulate(RecordingName("01", "right", "rom"), 7, Realism.exact(), 240)
    in_metres = replace(poses, position_mm=poses.position_mm / 1000)
    write_poses(folder / "poses.parquet", poses, "right", "rom")
    write_poses(folder / "metres.parquet", in_metres, "right", "rom")
    rows = [f"{i};{i / 240};{name};{i % 7};{k};0.5;1;0;0;0" for i in range(40)
            for k, name in enumerate(("hand", "index_proximal"))]  # fmt: skip
    (folder / "rom.ssv").write_text("\n".join(["frame;time_s;segment;x_mm;y_mm;z_mm;qw;qx;qy;qz", *rows, ""]))
    text = "format: semicolons\nposition_unit: mm\nreceivers: {hand: {value: 1}}\n"
    (folder / "mapping.yaml").write_text(text, "utf-8")
    row, header = "01 right rom both rom.ssv semicolons", "subject hand task role file format"
    write_study(folder, row, header=header, models=["mine"], more="exports: [frames]\n")
    commands = (
        "stage solve_joints --poses poses.parquet --layout liberty16 --model mine --out joints.parquet",
        "stage check_recordings --poses metres.parquet --layout liberty16 --out findings.parquet",
        "import --in rom.ssv --out read.parquet --subject 01 --hand right --task rom --layout liberty16",
        "import --in rom.ssv --out mapped.parquet --subject 01 --hand right --task rom --layout liberty16 "
        "--mapping mapping.yaml",
        "inspect rom.ssv",
        "new drafted --recordings .",
        "stage plan --study study.yaml --results . --subject 01 --out plan.json",
        f"stage export --plan {hand.plan_path} --model {FITTED} --formats frames --out exports",
    )
    asked = json.dumps([command.split() for command in commands])
    environment = os.environ | {"PYTHONPATH": str(program)}
    printed_by(sys.executable, "-c", RUN, input=asked, cwd=folder, env=environment)
    return folder


def test_an_added_model_solves_joints(folder: Path) -> None:
    rows = pq.read_table(folder / "joints.parquet")
    assert set(rows["model"].to_pylist()) == {"mine"}
    assert np.isfinite(rows["parent_x_mm"].drop_null().to_numpy()).any()


def test_an_added_column_is_written_with_its_unit(folder: Path) -> None:
    rows = pq.read_table(folder / "findings.parquet")
    assert rows["n_words"].to_pylist() == [len(text.split()) for text in rows["message"].to_pylist()] != []
    assert rows.schema.field("n_words").metadata[b"unit"] == b"words"


def test_an_added_reader_is_used_by_import_mapping_and_new(folder: Path) -> None:
    """A study's plan uses it too: without the reader, the stage `plan` of the fixture would fail."""
    for name in ("read", "mapped"):
        assert pq.read_table(folder / f"{name}.parquet").num_rows >= 80
    assert "rom.ssv" in (folder / "drafted" / "recordings.tsv").read_text("utf-8")


def test_an_added_format_is_exported(folder: Path, hand: SimulatedHand) -> None:
    (written,) = (folder / "exports").glob("*.frames")
    assert list(map(int, written.read_text().split())) == hand.motion(FITTED).frame.tolist()


MODEL_ON_PAPER = REPOSITORY / "docs" / "whole-hand.md"
NOT_OF_THE_FIT = {"JOINTWISE_SLIDE_SD_MM", "JOINTWISE_TILT_SD", "UNKNOWN_SLIDE_SD_MM", "DIP_BY_PIP_SD_DEG"}
PRINT_MODEL = """
import json, numpy as np
from shukotsu.fit.chain import hand_model
from shukotsu.fit.compiled_equations import reach
from shukotsu.study.layout import read_layout
layout = read_layout("liberty16")
worn = [name for name in layout.measured if not layout.segments[name].optional]
model = hand_model(layout, worn, worn, np.zeros(3))
y, at, moves = np.ones((1, len(model.states.names))), (np.eye(3)[None], np.zeros((1, 3))), {}
for branch in model.branches:
    reached = reach(branch, np.zeros(len(model.unknowns.names)), y, *at)
    by_x = branch.by_unknown(branch.by_operation(reached, range(len(branch.marks))), y)[:, 0]
    for mark, name in enumerate(branch.marks):
        for unknown, moved in zip(branch.unknowns, by_x[mark].T):
            moves[f"{name}: {model.unknowns.names[unknown]}"] = float(np.linalg.norm(moved[:3]))
print(json.dumps(moves))
"""
"""Prints how far, in mm, each unknown moves each bone and receiver with all joints bent by 1 rad."""


def moves_of(program: Path) -> dict[str, float]:
    environment = os.environ | {"PYTHONPATH": str(program)}
    return dict(json.loads(printed_by(sys.executable, "-c", PRINT_MODEL, cwd=program, env=environment)))


def test_the_example_edits_of_the_model_on_its_page_work(tmp_path: Path) -> None:
    """The page's edits of a prior, a law of skin and an unknown, made in a copy, change these and nothing
    else.
    """
    before, program = moves_of(REPOSITORY), copy_of_the_program(tmp_path / "program")
    for block in blocks(MODEL_ON_PAPER, "diff"):
        name, *lines = block.text.removeprefix("--- ").splitlines()
        old, new = ("".join(f"{line[1:]}\n" for line in lines if line[0] == sign) for sign in "-+")
        edit(program / name, old, new)
    after, knuckle = moves_of(program), "bone index_proximal: index z direction"
    assert after[knuckle] == pytest.approx(2 / 3 * before[knuckle])
    assert after.pop("bone ring_middle: palm arch") == pytest.approx(1.5)
    relaxed_rad = np.radians(25.0)
    assert after.pop("receiver index_middle: skin swelling") == pytest.approx(0.3 * (1.0 - relaxed_rad))
    same = {name for name in before if "direction" not in name}
    assert {name: after[name] for name in same} == {name: pytest.approx(before[name]) for name in same}


def test_the_page_lists_every_sd_of_the_fit() -> None:
    """Each row of its table equals the constants, and no sd is missing."""
    rows = re.findall(r"^\| ([A-Z][A-Z_]+_?.*?) \| ([\d., ]+) \|", MODEL_ON_PAPER.read_text("utf-8"), re.M)
    numbers, written = read_constants(REPOSITORY / "shukotsu" / "hand" / "average_hand.yaml"), set()
    for what, values in rows:
        names, parts = re.findall(r"[A-Z][A-Z_0-9]{3,}", what), re.findall(r"[a-z_]{3,}", what)
        expected: list[float] = []
        for name in filter(numbers.__contains__, names):
            value = numbers[name]
            expected += (
                [value[part] for part in parts] if isinstance(value, dict) else np.ravel(value).tolist()
            )
            written.add(name)
        assert not expected or [float(value) for value in values.split(", ")] == expected, what
    assert {name for name in numbers if "_SD" in name} <= written | NOT_OF_THE_FIT


def test_every_module_of_the_fit_refers_to_sections_of_its_page() -> None:
    there = {heading.partition("-")[0] for heading in anchors(MODEL_ON_PAPER)}
    for module in (REPOSITORY / "shukotsu" / "fit").glob("*.py"):
        named = re.findall(r"docs/whole-hand\.md, (?:whose|sections?) (.*)\.", module.read_text("utf-8"))
        assert named, module
        assert set(re.findall(r"\d+", " ".join(named))) <= there, module
