"""Figure files: valid SVG and PDF of the right size, text kept as text, reproducible bytes, any subject
name.
"""

import os
import re
import subprocess
import sys
import warnings
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure
from report_samples.made_study import MadeStudy, make_study, many_subjects
from stage_runs import print_figures

from shukotsu.report.figures import drawing
from shukotsu.report.figures.drawing import Drawing, Panel, PanelRow, Scale
from shukotsu.report.figures.study_figures import of_study
from shukotsu.report.figures.style import label
from shukotsu.report.palette import Look
from shukotsu.report.study_results import StudyResults
from shukotsu.study.results import FIGURE_KINDS, STUDY_FIGURES

REPOSITORY = Path(__file__).resolve().parents[3]
NAMES = sorted(f"{name}.{kind}" for name in STUDY_FIGURES for kind in FIGURE_KINDS)
TEXT = "{http://www.w3.org/2000/svg}text"


def words_of(study: MadeStudy, out: Path) -> list[str]:
    return ["--study", str(study.file), "--results", str(study.folder), "--out", str(out)]


def texts(svg: Path) -> list[str]:
    return ["".join(element.itertext()) for element in ElementTree.parse(svg).iter(TEXT)]


@pytest.mark.slow
def test_two_processes_write_the_same_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second process runs later, with another hash seed and time zone."""
    first, second = tmp_path / "first", tmp_path / "second"
    files = many_subjects(tmp_path, 3)
    assert print_figures(words_of(files, first)) == 0
    lines = capsys.readouterr().err.splitlines()
    for name, line in zip(("ranges-of-motion", "groups"), lines, strict=True):
        assert name in line, "this study has no movement and no factors"
    script = str(REPOSITORY / "stages" / "print_figures.py")
    command = [sys.executable, "-W", "error", script, *words_of(files, second)]
    environment = {**os.environ, "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo"}
    subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, check=True)
    assert sorted(path.name for path in first.iterdir()) == NAMES
    for name in NAMES:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.fixture(scope="module")
def drawings(twelve: StudyResults, fitted_study: MadeStudy) -> dict[str, Drawing]:
    return {drawn.name: drawn for drawn in of_study(twelve, fitted_study.study)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "labels"),
    [
        ("models", ("True joint error [mm]", "n = 12 subjects, held out", "whole-hand", "a")),
        ("joint-trust", ("Hands [%]", "ring_dip")),
    ],
)
def test_text_stays_text_and_the_pdf_has_the_column_width(
    drawings: dict[str, Drawing], tmp_path: Path, name: str, labels: tuple[str, ...]
) -> None:
    drawing.save(tmp_path, drawings[name])
    assert set(labels) <= set(texts(tmp_path / f"{name}.svg"))
    pdf = (tmp_path / f"{name}.pdf").read_bytes()
    ((width, height),) = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", pdf)
    assert float(width) / 72 * 25.4 == pytest.approx(175.0, abs=0.01)
    assert float(height) / 72 * 25.4 < 240
    assert b"/CIDFontType2" in pdf  # TrueType, not Type 3
    assert b"/Type3" not in pdf
    assert b"CreationDate" not in pdf
    assert (tmp_path / f"{name}.txt").read_text("utf-8") == drawings[name].caption + "\n"


def test_names_are_drawn_literally_or_with_codes_for_missing_glyphs(tmp_path: Path) -> None:
    as_they_are = ["$x_1$", r"\frac{1}", "<&>\"'", "é–Ω"]
    names = [*as_they_are, "山田", "a\tb\x07", "𝒳🖐"]

    def named() -> tuple[Figure, str]:
        rows = [PanelRow(name, Look("black", "o")) for name in names]
        draw = partial(drawing.draw_rows, rows=rows, axis="mm", scale=Scale(0.0, 1.0))
        panel = Panel("", "", 3.6 * len(rows), 9.0, draw)
        return drawing.print_figure([[panel]], figure_mm=60.0), ";".join(names)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drawing.save(tmp_path, drawing.draw_figure("named", named))
    assert {*map(label, names)} <= {*texts(tmp_path / "named.svg")}
    assert (tmp_path / "named.txt").read_text("utf-8").startswith(";".join(names))
    assert [name for name in names if label(name) == name] == as_they_are
    assert all(label(name).isprintable() for name in names)


@pytest.mark.slow
def test_a_study_with_hostile_names_is_drawn_without_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    subject = "山田 $x_1$ \\frac"
    study = make_study(tmp_path, models=("paper-fig4",), subjects=(subject,))
    out = tmp_path / "figures"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert print_figures([*words_of(study, out), "--recording", subject, "right", "opposition"]) == 0
        folder = f"{out}/sub-山田%20%24x_1%24%20%5Cfrac/right/opposition"
        assert capsys.readouterr().err == (
            f"{folder}/joint-angles: Not drawn: joint angles need a model that fits the whole hand, and this "
            f"study has none.\n{folder}/cycle-curves_paper-fig4: Not drawn: paper-fig4 has no joint angle in "
            "the cycles of this recording.\n"
        )
        assert print_figures(words_of(study, out)) == 0
    assert {path.name for path in out.iterdir() if path.is_file()} == {*NAMES}
    (svg,) = out.glob("*/right/opposition/tip-error.svg")
    assert "Tip error [mm]" in texts(svg)


@pytest.mark.slow
def test_a_failure_is_printed_or_drawn_as_a_sentence(
    study: MadeStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = words_of(MadeStudy(study.file, tmp_path), tmp_path / "figures")
    expected = f"{tmp_path}/recordings.parquet: no such file; expected a recordings table"
    assert print_figures(words) == 2
    assert capsys.readouterr().err == f"error: {expected}\n"
    assert not (tmp_path / "figures").exists()
    assert print_figures([*words, "--record-failure"]) == 0
    for name in STUDY_FIGURES:
        assert (tmp_path / "figures" / f"{name}.txt").read_text() == f"Not drawn: {expected}.\n"
        assert texts(tmp_path / "figures" / f"{name}.svg")[0].startswith("Not drawn: ")
