"""A study that asks for exports gets every format of every model, and is told what could not be written."""

from __future__ import annotations

import json

import pytest
from studies.running import StudyRun, record, write_study

from shukotsu.export.registry import FORMATS

pytestmark = pytest.mark.slow

MODELS = ("paper-fig4", "rigid")
FORMATS_ASKED = ("bvh", "glb", "osim", "c3d", "bids", "csv")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """Two subjects, one recording each; the second's index fingertip is lost every 50 frames."""
    folder = tmp_path_factory.mktemp("exports")
    record(folder / "01.csv", subject="01", frames=700)
    record(folder / "02.csv", subject="02", frames=700)
    lines = (folder / "02.csv").read_text("utf-8").splitlines()
    kept = [line for line in lines if ',"index_distal",' not in line or int(line.split(",")[0]) % 50]
    assert len(kept) < len(lines)
    (folder / "02.csv").write_text("\n".join(kept) + "\n", "utf-8")
    rows = [f"{name}\tright\trom\tboth\t{name}.csv" for name in ("01", "02")]
    keys = {"exports": f"[{', '.join(FORMATS_ASKED)}]", "export_settings": "{rig: webxr, licence: CC-BY-4.0}"}
    study = write_study(folder, "moving", rows, list(MODELS), **keys)
    study.run()
    return study


def _files(study: StudyRun, model: str, subject: str) -> set[str]:
    names = {path.name for path in study.results.exports.iterdir()}
    return {name for name in names if name.startswith(f"sub-{subject}_") and f"_model-{model}" in name}


@pytest.mark.parametrize("model", MODELS)
def test_every_format_of_every_model_or_why_it_is_not_there(study: StudyRun, model: str) -> None:
    """Formats that hold gaps are written; those that do not say why they are not."""
    stem = f"sub-01_hand-right_task-rom_model-{model}"
    wanted = {stem + end for name in FORMATS_ASKED if name != "bids" for end in FORMATS[name].extensions}
    assert _files(study, model, "01") == {*wanted, f"{stem}.bvh.txt"}
    stem, names = stem.replace("01", "02"), _files(study, model, "02")
    holding = {name for name in FORMATS_ASKED if FORMATS[name].holds_gaps and name != "bids"}
    assert {stem + FORMATS[name].extensions[0] for name in holding} <= names
    failed = {f"{stem}_{name}.failed.txt" for name in ("bvh", "glb", "osim")}
    assert failed <= names
    page = study.page()
    for name in failed:
        assert name.removesuffix(".failed.txt") in page
    assert "choose --gaps hold, cut or interpolate" in page


def test_all_subjects_are_in_one_folder_that_takes_no_room(study: StudyRun) -> None:
    """Files of one folder, links to those that the subjects' jobs wrote."""
    folders = {path for path in study.results.exports.iterdir() if path.is_dir()}
    assert folders == {study.results.dataset, study.results.exports / "tables"}
    package = json.loads((study.results.exports / "tables" / "datapackage.json").read_text("utf-8"))
    assert {resource["name"] for resource in package["resources"]} >= {
        "recordings",
        "ranges_of_motion",
        "problems",
    }
    for subject in ("01", "02"):
        for file in study.results.subject_exports(subject).glob("sub-*"):
            assert (study.results.exports / file.name).samefile(file)


def test_a_format_less_leaves_nothing_of_it(study: StudyRun) -> None:
    """The last test: the study is another one then."""
    text = study.file.read_text("utf-8")
    study.file.write_text(text.replace("[bvh, ", "[").replace(", bids", ""), "utf-8")
    study.run()
    names = {path.name for path in study.results.exports.iterdir()}
    assert not [name for name in names if "bvh" in name or "bids" in name]
    assert "sub-01_hand-right_task-rom_model-rigid.glb" in names
    assert study.planned() == set()
