"""The files and requests of jobs: each depends on what it reads of the study, and on no more."""

import os
import shlex
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from small_study import write_study
from stage_runs import plan as write_plan

from shukotsu.errors import InputError
from shukotsu.report.figures import style
from shukotsu.study.config_files import CONFIG_FOLDER, REFERENCE
from shukotsu.study.plan import plan_text, read_plan
from shukotsu.study.results import FIT_TABLES, GATHERED_TABLES, STUDY_TABLES
from shukotsu.workflow.study_files import StudyFiles, study_file

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
    """The working directory of a study in a folder of it, of which a model fits each hand by itself."""
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


def test_paths_of_a_subject(folder: Path) -> None:
    study = files(folder)
    assert study.file == "study/study.yaml"
    assert study.subject(FIT) == ("A&b", "")
    assert study.model(FIT) == "alone"
    poses = [
        f"results/test/{SUBJECT}/{name}/poses.parquet" for name in ("right/rom", "right/pinch_1", "left/rom")
    ]
    assert study.poses(FIT) == poses, "excluded ones are none"
    assert study.poses_of_fit(FIT) == poses[:2], "of one hand"
    fits = [f"results/test/{SUBJECT}/fits/{hand}/alone" for hand in ("right", "left")]
    assert study.fits("gains")["gains"](FIT) == [f"{fit}/gains.parquet" for fit in fits]
    anatomys = [f"results/test/{SUBJECT}/fits/{hand}/{REFERENCE}" for hand in ("right", "left")]
    assert set(study.fit_tables(FIT)) == {f"{fit}/{t}.parquet" for fit in fits + anatomys for t in FIT_TABLES}
    assert f"results/test/{SUBJECT}/tip_errors.parquet" in study.subject_tables(FIT)
    assert study.plans == [f"results/test/{subject}/plan.json" for subject in (SUBJECT, "sub-02")]


def test_files_of_the_whole_study(folder: Path) -> None:
    study = files(folder)
    gathered = {*study.gathered()}
    assert {Path(path).stem for path in gathered} >= {*GATHERED_TABLES, *FIT_TABLES}
    assert study.all_poses() == [path for path in study.tables if path.endswith("/poses.parquet")]
    assert gathered < set(study.tables)
    assert study.study_tables == [f"results/test/{name}.parquet" for name in STUDY_TABLES]
    names = {Path(path).name for path in study.configuration}
    sheets = {f"{name}.tsv" for name in (*SHEETS, "recordings")}
    assert names == {"study.yaml", "liberty16.yaml", "rigid.yaml", "alone.yaml"} | sheets


def test_a_recordings_file_that_is_missing_stops_no_other(folder: Path) -> None:
    """Its import says so. What is simulated is made, whether or not it is there."""
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
    made = ["study/made/sub-A%26b_hand-right_task-rom.arrows"]
    assert (simulated.simulated_recording(ROM), simulated.recording_files(ROM)) == (made, [])
    assert simulated.truth(ROM)[0] == "study/made/sub-A%26b_hand-right_task-rom_truth/joint_centres.parquet"


@pytest.mark.parametrize("name", ["a{1}.csv", "a<b>.csv", "{subject}.csv"])
def test_a_name_that_snakemake_would_read_as_its_own_is_no_input(folder: Path, name: str) -> None:
    """A change of it is told by the digest of its content."""
    rows = (f"A&b right rom calibration data/{name}", "A&b right pinch both data/b.csv")
    missing = files(folder, *rows).recording_digest(ROM)
    (folder / "study/data").mkdir()
    (folder / "study/data" / name).write_text("1")
    (folder / "study/data/b.csv").write_text("2")
    study = files(folder, *rows)
    pinch = SimpleNamespace(subject=ROM.subject, hand="right", recording="pinch")
    assert (study.recording_files(ROM), study.recording_files(pinch)) == ([], ["study/data/b.csv"])
    assert study.recording_digest(ROM) != missing


def test_a_folder_that_snakemake_would_read_as_its_own_is_refused(folder: Path) -> None:
    message = r"study/made \{1\}: its path holds \{\.\.\.\} or <\.\.\.>, which Snakemake reads as its own"
    with pytest.raises(InputError, match=message):
        files(folder, more="simulation: {folder: 'made {1}', seed: 3}\n")
    with pytest.raises(InputError, match=r"^odd <b>/study.yaml: its path holds"):
        StudyFiles(write_study(folder / "odd <b>", *ROWS))


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
def test_a_job_is_run_again_for_what_it_uses(folder: Path, change: str) -> None:
    before = files(folder)
    requests: dict[str, Callable[[StudyFiles], str]] = {
        "plan": lambda study: study.plan(FIT),
        "import_options": lambda study: study.import_options(ROM),
        "fit_plan": lambda study: study.fit_plan(FIT),
    }
    first = {name: request(before) for name, request in requests.items()}
    rows, sheets, models = CHANGES[change]
    after = files(folder, *rows, models=models, **sheets)
    changed = {name for name, request in requests.items() if request(after) != first[name]}
    assert changed == {name for name, changes in AGAIN.items() if change in changes}


def test_a_language_without_a_font_is_refused_before_anything_runs(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(style, "font_of", lambda _: None)
    with pytest.raises(InputError, match="language: ja: its figures need a font"):
        files(folder, more="language: ja\n")


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


def test_what_is_exported(folder: Path) -> None:
    assert files(folder).exports == []
    more = "exports: [bvh, bids]\nexport_settings: {models: [rigid]}\n"
    study = files(folder, more=more)
    assert study.export_formats == ["bvh"]
    folders = [f"results/test/{name}" for name in (f"{SUBJECT}/exports", "sub-02/exports", "dataset")]
    assert (study.exports, study.export_folders) == (["results/test/exports"], folders)
    assert "--models=rigid" in shlex.split(study.export_options)
    assert files(folder, more="exports: [bids]\n").export_folders == ["results/test/dataset"]


def test_a_run_is_of_one_study_as_its_file_says(folder: Path) -> None:
    path = write_study(folder / "study", *ROWS)
    config = yaml.safe_load(path.read_text())
    assert study_file([path], config, is_module=False) == path
    assert study_file([], {}, is_module=False) == Path("config", "demo.yaml")
    with pytest.raises(InputError, match="--configfile: names several files"):
        study_file([path, path], config, is_module=False)
    with pytest.raises(InputError, match=r"--config: .*; write it into .*study/study\.yaml"):
        study_file([path], config | {"layout": "arm"}, is_module=False)


def test_a_module_is_of_the_study_that_its_keys_say(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    path = write_study(folder / "study", *ROWS)
    config = yaml.safe_load(path.read_text())
    assert study_file([path], config, is_module=True) == path
    other = config | {"recordings": "elsewhere.tsv"}
    written = study_file([path], other, is_module=True)
    assert written == Path("test.module.yaml")
    assert yaml.safe_load(written.read_text()) == other
    with pytest.raises(InputError, match=r"^config: .*study"):
        study_file([], {}, is_module=True)


def test_models_of_whole_hands_are_refused_where_no_layout_is_a_hand(folder: Path) -> None:
    """With another model, or a hand, the study runs, and each arm is a problem of its own."""
    path = write_study(folder / "arms", "01 right rom both a.csv - arm", models=("whole-hand",))
    with pytest.raises(
        InputError, match=r"study\.yaml: models: model whole-hand fits .* layout arm is none, .*"
    ):
        StudyFiles(path)
    more = write_study(folder / "more", "01 right rom both a.csv - arm", models=("whole-hand", "paper-fig4"))
    assert StudyFiles(more).study.models
    both = ("01 right rom both a.csv - arm", "02 right rom both b.csv")
    assert StudyFiles(write_study(folder / "both", *both, models=("whole-hand",))).study.models


def test_the_plan_command_writes_the_subjects_plan(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = files(folder)
    argv = ["--study", study.file, "--results", "results/test", "--out", study.plans[0]]
    assert write_plan([*argv, "--subject", "A&b"]) == 0
    read = read_plan(Path(study.plans[0]))
    assert (read.subject, read.folder) == ("A&b", Path("results/test", SUBJECT))
    before = Path(study.plans[0]).read_bytes()
    assert write_plan([*argv, "--subject", "A&b"]) == 0
    assert Path(study.plans[0]).read_bytes() == before
    assert write_plan([*argv, "--subject", "nobody"]) == 2
    assert "has no subject 'nobody'; expected one of A&b, 02" in capsys.readouterr().err
    assert plan_text({"plan": 1}).endswith("\n")


def test_a_job_asks_for_more_the_longer_the_recordings_are_and_for_so_much_memory_at_most(
    folder: Path,
) -> None:
    study, asked = files(folder), []
    path = Path(study.subjects[-1].recordings[0].file)
    path.parent.mkdir(parents=True)
    for size in (0, 10**8, 10**10, 10**11):
        with path.open("wb") as file:
            file.truncate(size)  # takes no room
        asked.append({name: of(SimpleNamespace(subject="02")) for name, of in study.resources(2, 10).items()})
    assert [own["runtime"] for own in asked] == [2, 3, 102, 1002]
    assert asked[0]["mem_mb"] < asked[1]["mem_mb"] < asked[2]["mem_mb"] == asked[3]["mem_mb"]
