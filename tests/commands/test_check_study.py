"""`shukotsu check` of a study and of a single recording: findings, notes and exit codes."""

import shutil
from pathlib import Path

import pytest
from small_study import write_plans, write_study
from stage_runs import check_recordings as check_recordings

from shukotsu.commands.check_file import main as check
from shukotsu.commands.import_file import main as import_recording
from shukotsu.commands.inspect_file import main as inspect
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.study.plan_file import read_plan
from shukotsu.tables.catalogue import FINDINGS
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.typed_table import read_table, rows_of
from shukotsu.workflow.study_files import import_options

ROWS = (
    "P1 right rom both rom.csv",
    "P1 right old evaluation rom.csv - - moved",
    "P2 left rom both rom.csv",
    "P2 left seen evaluation rom.csv - - - on-video",
    "P2 left lost evaluation lost.csv",
    "P2 left gone evaluation lost.csv",
)


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_recording(Path("rom.csv"), simulate(RecordingName("P1", "right", "rom"), 3, Realism(), 360))
    return write_study(tmp_path, *ROWS)


def of_run(study: Path) -> set[tuple[str, ...]]:
    """Return (recording, severity, kind, message) of all findings that the stages of a run write."""
    findings = set()
    for path in write_plans(study).values():
        plan = read_plan(path)
        for recording in plan.recordings:
            if not recording.exclude:
                poses = plan.poses(recording)
                poses.parent.mkdir(parents=True)
                argv = ["--record-failure", *import_options(recording), f"--out={poses}"]
                assert import_recording(argv) == 0
        assert check_recordings(["--plan", str(path), "--out", str(plan.table("findings"))]) == 0
        for row in rows_of(read_table(plan.table("findings"), FINDINGS)):
            name = f"{plan.who.subject} {row['hand']} {row['task']}"
            findings.add((name, *(row[column] for column in ("severity", "kind", "message"))))
    return findings


@pytest.mark.slow
def test_checking_a_study_gives_the_findings_of_its_run(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(Path().rglob("*"))
    assert check([str(study)]) == 2
    out, err = capsys.readouterr()
    assert not err
    assert sorted(Path().rglob("*")) == before
    first, *lines = out.splitlines()
    assert first.endswith("study test, 2 subjects, 6 recordings, 2 models")
    lost = [line for line in lines if "cannot be read" in line]
    assert lost == [
        "P2 left lost, P2 left gone: cannot be read: lost.csv: no such file; expected a recording"
    ]
    printed = {
        (name, *rest.split(": ", 2))
        for line in lines
        for names, rest in [line.split(": ", 1)]
        for name in names.split(", ")
        if line not in lost
    }
    assert {kind for _, _, kind, _ in printed} >= {"same-file", "wrong-hand"}
    of_stages = of_run(study)
    assert printed >= of_stages
    of_the_study = {(name, severity, kind) for name, severity, kind, _ in printed - of_stages}
    copies = {("P2 left rom", "suspect", "same-file"), ("P2 left seen", "note", "same-file")}
    assert of_the_study == copies, "as written by `gather`"


def test_subjects_that_are_missing_in_a_sheet_are_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("loop.csv").symlink_to("loop.csv")
    write_study(tmp_path, "01 right rom both loop.csv", participants="subject hand_length_mm\n1 180\n")
    assert check([]) == 2
    assert "note: participants.tsv: has no row of '01', and row 2 is of '1'" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ("P1 right rom both rom.csv", 0),
        ("P1 left rom both rom.csv - - - on-video", 0),
        ("P1 left rom both rom.csv", 1),
        (f"P1 right old both {'f' * 300}.csv", 2),
    ],
)
def test_the_exit_code_is_that_of_the_worst_finding(study: Path, row: str, code: int) -> None:
    """An accepted finding counts as a note, a row that is left out as a recording that cannot be read."""
    rows = ["P1 right rom both rom.csv", row] if code == 2 else [row]
    assert check([str(write_study(study.parent, *rows))]) == code


@pytest.mark.parametrize("ending", ["parquet", "arrows"])
def test_a_recording_that_a_run_will_simulate_is_not_missing(
    study: Path, ending: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Everything else is checked, also a missing file of the same study that no run makes."""
    more = "simulation: {folder: made, seed: 3}\n"
    simulated = f"P1 right rom calibration made/sub-P1_hand-right_task-rom.{ending}"
    assert check([str(write_study(study.parent, simulated, "P2 right rom both rom.csv", more=more))]) == 0
    says = "simulated: not made yet, so not checked; `shukotsu run` makes it"
    assert f"P1 right rom: {says}" in capsys.readouterr().out.splitlines()
    lost = simulated.replace("P1 right rom", "P1 right lost", 1)
    assert check([str(write_study(study.parent, simulated, lost, more=more))]) == 2
    assert "P1 right lost: cannot be read: sub-P1_hand-right_task-rom" in capsys.readouterr().out


@pytest.fixture(scope="module")
def rom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rom") / "rom.csv"
    write_recording(path, simulate(RecordingName("P1", "right", "rom"), 3, Realism(), 600))
    return path


@pytest.mark.slow
def test_a_good_recording_has_three_suggested_measurements(
    rom: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check([str(rom), "--hand", "right"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "no finding"
    assert len(lines) == 4
    assert all(line.startswith(("Measuring ", "Touching ")) for line in lines[1:])
    assert list(rom.parent.iterdir()) == [rom]  # nothing is left beside it


def test_the_other_hand_is_the_only_finding(rom: Path, capsys: pytest.CaptureFixture[str]) -> None:
    renamed = shutil.copy(rom, rom.parent.with_suffix(".odd"))
    assert check([str(renamed), "--hand", "left", "--format", "csv"]) == 1
    out = capsys.readouterr().out
    assert out.startswith("suspect: wrong-hand: This seems to be a right hand")
    assert "Measuring" not in out


TYPOS = {
    "study.yaml: model 'rigd' is neither": ("rigd", "", ""),
    "study.yaml: language: is 'fr'; expected one of en, ja": ("rigid", "", "language: fr"),
    "sheets/recordings.tsv: row 2, column layout: layout 'libery16' is": ("rigid", " - libery16", ""),
}


@pytest.mark.parametrize("message", TYPOS)
def test_a_typo_is_refused_with_its_place(
    study: Path, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model, cells, more = TYPOS[message]
    write_study(study.parent, f"P1 right rom both rom.csv{cells}", models=[model], more=more)
    assert check([study.name]) == 2
    assert capsys.readouterr().err.startswith(f"error: {message}")


def test_a_quantity_that_cannot_be_measured_is_refused_as_in_a_run(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sheet = "subject hand quantity value_mm sd_mm\nP1 right index_proximl 40 1\n"
    write_study(study.parent, "P1 right rom both rom.csv", measurements=sheet)
    assert check([study.name]) == 2
    assert "'index_proximl' cannot be measured on layout liberty16; did you mean" in capsys.readouterr().out


def test_the_next_command_can_be_copied_if_the_path_has_a_space(
    rom: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (path := tmp_path / "a b.csv").write_text(rom.read_text("utf-8").replace("x_mm", "px"), "utf-8")
    assert check([str(path), "--hand", "right"]) == 2
    assert f"`shukotsu inspect '{path}' --write-mapping" in capsys.readouterr().err
    assert inspect([str(path)]) == 0
    assert f"next: shukotsu inspect '{path}' --write-mapping" in capsys.readouterr().out


def test_a_receiver_that_never_moves_did_not_fall_off(
    rom: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = rom.read_text("utf-8").splitlines()
    first = next(line for line in lines if '"middle_distal"' in line).split(",")[3:]
    for n, line in enumerate(lines):
        if '"middle_distal"' in line:
            lines[n] = ",".join([*line.split(",")[:3], *first])
    (path := tmp_path / "stuck.csv").write_text("\n".join(lines) + "\n", "utf-8")
    assert check([str(path), "--hand", "right"]) == 1
    assert [line.split(": ")[1] for line in capsys.readouterr().out.splitlines()] == ["receiver-stuck"]
