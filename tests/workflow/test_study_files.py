"""Files and parameters of jobs: each job depends on exactly the parts of the study that it uses."""

import os
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from small_study import write_study

from shukotsu.errors import InputError, list_names
from shukotsu.study.config_files import CONFIG_FOLDER, REFERENCE
from shukotsu.study.results import FIT_TABLES
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow import study_files
from shukotsu.workflow.file_digests import STAMP
from shukotsu.workflow.one_run import study_file
from shukotsu.workflow.study_files import StudyFiles

ROWS = (
    "A&b right rom calibration data/a.csv",
    "A&b right pinch both made/b.arrows 1",
    "A&b left rom both data/c.csv",
    "A&b left pinch both data/d.csv - - moved",
    "02 right rom both data/e.csv",
)
SHEETS = {
    "participants": "subject hand_length_mm hand_breadth_mm\nA&b 180 80\n02 170 75",
    "corrections": "subject hand joint dx_mm dy_mm dz_mm\nA&b right thumb_ip 1 2 3",
    "measurements": "subject hand quantity value_mm sd_mm\nA&b right hand_breadth 80 2",
}
MODELS = ("rigid", "alone.yaml")
SUBJECT = "sub-A%26b"
SIMULATION = "simulation: {folder: made, seed: 3}\n"
FIT = SimpleNamespace(subject="A%26b", hand="right", model="alone")
ROM = SimpleNamespace(subject="A%26b", hand="right", recording="rom")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study").mkdir()
    config = yaml.safe_load((CONFIG_FOLDER / "models" / "whole-hand.yaml").read_text())
    config |= {"model": "alone", "fit": config["fit"] | {"share_lengths": False}}
    (tmp_path / "study/alone.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    return tmp_path


def files(
    folder: Path, *rows: str, more: str = "", models: tuple[str, ...] = MODELS, **sheets: str
) -> StudyFiles:
    return StudyFiles(
        write_study(folder / "study", *(rows or ROWS), models=models, more=more, **SHEETS | sheets)
    )


def test_a_subjects_paths_leave_out_excluded_recordings(folder: Path) -> None:
    study = files(folder)
    assert study.file == "study/study.yaml"
    assert study.subject(FIT) == ("A&b", "")
    assert study.model(FIT) == "alone"
    poses = [
        f"results/test/{SUBJECT}/{name}/poses.parquet" for name in ("right/rom", "right/pinch_1", "left/rom")
    ]
    assert study.poses(FIT) == poses, "without excluded recordings"
    assert study.poses_of_fit(FIT) == poses[:2], "only of one hand"
    fits = [f"results/test/{SUBJECT}/fits/{hand}/alone" for hand in ("right", "left")]
    assert study.fits("gains")["gains"](FIT) == [f"{fit}/gains.parquet" for fit in fits]
    anatomys = [f"results/test/{SUBJECT}/fits/{hand}/{REFERENCE}" for hand in ("right", "left")]
    assert set(study.fit_tables(FIT)) == {f"{fit}/{t}.parquet" for fit in fits + anatomys for t in FIT_TABLES}
    assert f"results/test/{SUBJECT}/tip_errors.parquet" in study.subject_tables(FIT)
    assert study.plans == [f"results/test/{subject}/plan.json" for subject in (SUBJECT, "sub-02")]


def test_a_missing_recording_is_not_an_input_of_a_job(folder: Path) -> None:
    """Its import reports it as missing. Simulated recordings are made by a job even if they do not exist."""
    study = files(folder, more=SIMULATION)
    assert study.recording_files(ROM) == []
    (folder / "study/data").mkdir()
    os.mkfifo(folder / "study/data/a.csv")
    assert study.recording_files(ROM) == [], "Snakemake would wait for it"
    (folder / "study/data/a.csv").unlink()
    (folder / "study/data/a.csv").write_text("")
    assert study.recording_files(ROM) == ["study/data/a.csv"]
    assert study.seed == 3
    assert study.streamed == "study/made/sub-{subject}_hand-{hand}_task-{task}.arrows"
    simulated = files(folder, "A&b right rom both made/sub-A%26b_hand-right_task-rom.arrows", more=SIMULATION)
    assert simulated.simulated_recording(ROM) == ["study/made/sub-A%26b_hand-right_task-rom.arrows"]
    assert simulated.recording_files(ROM) == []
    assert simulated.truth(ROM)[0] == "study/made/sub-A%26b_hand-right_task-rom_truth/joint_centres.parquet"


@pytest.mark.parametrize("name", ["a{1}.csv", "a<b>.csv", "{subject}.csv"])
def test_a_file_with_snakemakes_special_characters_is_not_an_input(folder: Path, name: str) -> None:
    rows = (f"A&b right rom calibration data/{name}", "A&b right pinch both data/b.csv")
    missing = files(folder, *rows).recording_digest(ROM)
    (folder / "study/data").mkdir()
    (folder / "study/data" / name).write_text("1")
    (folder / "study/data/b.csv").write_text("2")
    study = files(folder, *rows)
    pinch = SimpleNamespace(subject=ROM.subject, hand="right", recording="pinch")
    assert (study.recording_files(ROM), study.recording_files(pinch)) == ([], ["study/data/b.csv"])
    assert study.recording_digest(ROM) != missing


Change = dict[str, str]
CHANGES: dict[str, tuple[tuple[str, ...], Change, tuple[str, ...]]] = {
    "role": (("A&b right rom both data/a.csv", *ROWS[1:]), {}, MODELS),
    "file": (("A&b right rom calibration data/z.csv", *ROWS[1:]), {}, MODELS),
    "other-hand": ((*ROWS[:2], "A&b left rom evaluation data/c.csv", *ROWS[3:]), {}, MODELS),
    "other-subject": ((*ROWS[:4], "02 right rom both data/f.csv", "03 left rom both data/g.csv"), {}, MODELS),
    "size": (ROWS, {"participants": SHEETS["participants"].replace("180", "181")}, MODELS),
    "correction": (ROWS, {"corrections": SHEETS["corrections"].replace("2 3", "2 4")}, MODELS),
    "measurement": (ROWS, {"measurements": SHEETS["measurements"].replace("80 2", "81 2")}, MODELS),
    "other-model": (ROWS, {}, ("paper-fig4", "alone.yaml")),
}
AGAIN = {
    "plan": {"role", "file", "other-hand", "size", "correction", "measurement", "other-model"},
    "import_options": {"file"},
    "fit_plan": {"role", "file", "size", "measurement"},
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_job_runs_again_only_for_changes_that_it_uses(folder: Path, change: str) -> None:
    before = files(folder)

    def requests(study: StudyFiles) -> dict[str, str]:
        imports = study.import_options(ROM)
        return {"plan": study.plan(FIT), "import_options": imports, "fit_plan": study.fit_plan(FIT)}

    first = requests(before)
    rows, sheets, models = CHANGES[change]
    after = requests(files(folder, *rows, models=models, **sheets))
    changed = {name for name, request in after.items() if request != first[name]}
    assert changed == {name for name, changes in AGAIN.items() if change in changes}


def test_a_layout_is_part_of_every_request(folder: Path) -> None:
    layout = folder / "study" / "mine.yaml"
    shipped = CONFIG_FOLDER / "layouts" / "liberty16.yaml"
    text = shipped.read_text().replace("layout: liberty16", "layout: mine")
    layout.write_text(text)
    rows = ("A&b right rom calibration data/a.csv - mine.yaml", "A&b right pinch both data/b.csv 1 mine.yaml")
    first = files(folder, *rows)
    layout.write_text(text + "\n# a comment\n")
    same = files(folder, *rows)
    config = yaml.safe_load(text)
    config["joints"]["index_dip"]["plane"] = {"normal": [0, 1, 0.1]}
    layout.write_text(yaml.safe_dump(config, sort_keys=False))
    other = files(folder, *rows)
    for request in ("plan", "fit_plan", "layout_digest"):
        assert getattr(same, request)(FIT) == getattr(first, request)(FIT), request
        assert getattr(other, request)(FIT) != getattr(first, request)(FIT), request


def test_changes_since_the_last_run_are_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that the study did not use before was added, not changed; the program is an input too."""
    laboratory = "models-of-the-whole-laboratory"
    for name in ("finger", "finger-rigid", "thumb"):
        text = (folder / "study/alone.yaml").read_text().replace("alone", name, 1)
        write_text(folder / laboratory / f"{name}.yaml", text)
    both = (f"../{laboratory}/finger.yaml", f"../{laboratory}/finger-rigid.yaml")
    assert files(folder, models=both).what_changed() == ""
    for name in both:
        path = folder / "study" / name
        path.write_text(f"{path.read_text()}# edited\n")
    size = SHEETS["participants"].replace("170", "171")
    assert files(folder, models=both, participants=size).what_changed() == (
        "changed since the last run: models-of-th...oratory/finger-rigid.yaml, models-of-th...le-laboratory/"
        "finger.yaml, study/sheets/participants.tsv; results made again: those of sub-02 and the study's"
    )
    other = (both[0], f"../{laboratory}/thumb.yaml")
    assert files(folder, models=other, participants=size).what_changed() == (
        "changed since the last run: study/study.yaml; added to the study: models-of-th...ole-laboratory/"
        "thumb.yaml; removed from the study: models-of-th...oratory/finger-rigid.yaml; results made again: "
        "those of sub-A%26b, sub-02 and the study's"
    )
    monkeypatch.setattr(study_files, "program_digest", lambda: "another")
    said = [files(folder, models=other, participants=size).what_changed() for _ in range(2)]
    assert said == ["changed since the last run: the program; results made again: all", ""]


def test_long_names_stay_different_when_they_are_listed() -> None:
    fits = [f"sub-01/fits/{hand}/whole-hand/fitted_joints.parquet" for hand in ("right", "left")]
    assert list_names(fits[:1]) == "sub-01/fits/...and/fitted_joints.parquet"
    assert list_names(fits) == ", ".join(fits)


def test_exports_follow_the_study_file(folder: Path) -> None:
    assert files(folder).exports == []
    more = "exports: [bvh, bids]\nexport_settings: {models: [rigid]}\n"
    study = files(folder, more=more)
    assert study.export_formats == ["bvh"]
    folders = [f"results/test/{name}" for name in (f"{SUBJECT}/exports", "sub-02/exports", "dataset")]
    assert (study.exports, study.export_folders) == (["results/test/exports"], folders)
    assert "--models=rigid" in shlex.split(study.export_options)
    assert files(folder, more="exports: [bids]\n").export_folders == ["results/test/dataset"]


def test_exports_that_are_no_longer_requested_are_removed(folder: Path) -> None:
    """Only files with names given by the program are removed; the user's files stay."""
    names = ("sub-02.csv", "bids/README", "tables/a.csv", STAMP, "notes.txt")
    made = [Path("results/test", top, name) for top in ("exports", "dataset", "tidy") for name in names]
    for path in made:
        write_text(path, "")
    said = "removed results that no longer belong to the study: "
    assert files(folder, more="exports: [csv]\n").remove_former() == f"{said}dataset"
    assert files(folder).remove_former() == f"{said}exports, tidy"
    assert {path for path in made if path.exists()} == {path for path in made if path.name == "notes.txt"}


def test_the_study_is_read_from_one_file_or_a_modules_keys(folder: Path) -> None:
    path = write_study(folder / "study", *ROWS)
    config = yaml.safe_load(path.read_text())
    for is_module in (False, True):
        assert study_file([path], config, is_module=is_module) == path
    assert study_file([], {}, is_module=False) == Path("config", "demo.yaml")
    other = config | {"recordings": "elsewhere.tsv"}
    written = study_file([path], other, is_module=True)
    assert (written, yaml.safe_load(written.read_text())) == (Path("test.module.yaml"), other)
    for files_named, keys, is_module, message in (
        ([path, path], config, False, "--configfile: names several files"),
        ([path], config | {"layout": "arm"}, False, r"--config: .*; write them into .*study/study\.yaml"),
        ([], {}, True, r"^config: .*study"),
    ):
        with pytest.raises(InputError, match=message):
            study_file(files_named, keys, is_module=is_module)


def test_a_folder_with_snakemakes_special_characters_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"^odd <b>/study.yaml: its path contains .* which mean something"):
        StudyFiles(write_study(folder / "odd <b>", *ROWS))


def test_whole_hand_models_are_refused_without_a_hand_layout(folder: Path) -> None:
    """With another model or a hand the study runs, and each arm is reported as a problem."""
    arm, hand = "01 right rom both a.csv - arm", "02 right rom both b.csv"
    with pytest.raises(InputError, match=r"study\.yaml: models: model whole-hand .* layout arm does not"):
        StudyFiles(write_study(folder / "arms", arm, models=("whole-hand",)))
    assert StudyFiles(write_study(folder / "more", arm, models=("whole-hand", "paper-fig4"))).study.models
    assert StudyFiles(write_study(folder / "both", arm, hand, models=("whole-hand",))).study.models


def test_jobs_request_time_and_bounded_memory_by_recording_size(folder: Path) -> None:
    study, asked = files(folder), []
    path = Path(study.subjects[-1].recordings[0].source.file)
    path.parent.mkdir(parents=True)
    for size in (0, 10**8, 10**10, 10**11):
        with path.open("wb") as file:
            file.truncate(size)  # a sparse file
        asked.append({name: of(SimpleNamespace(subject="02")) for name, of in study.resources(2, 10).items()})
    assert [request["runtime"] for request in asked] == [2, 3, 102, 1002]
    assert asked[0]["mem_mb"] < asked[1]["mem_mb"] < asked[2]["mem_mb"] == asked[3]["mem_mb"]
