"""A study from `shukotsu new` to report and exports with the command `shukotsu` alone."""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from studies.running import REPOSITORY, record, shukotsu, write_study

pytestmark = pytest.mark.slow


def test_a_new_study_is_run_to_report_and_exports(tmp_path: Path) -> None:
    record(tmp_path / "captures" / "rom.parquet", subject="01", task="rom")
    assert shukotsu(tmp_path, "new", "piano", "--recordings", "captures").returncode == 0
    folder = tmp_path / "piano"
    sheet = folder / "recordings.tsv"
    sheet.write_text(sheet.read_text().replace("\t\trom\tcalibration\t", "01\tright\trom\tboth\t"))
    study = folder / "study.yaml"
    study.write_text(study.read_text().replace("[rigid, paper-fig4, whole-hand]", "[rigid]"))

    assert "1 subject, 1 recording, 1 model" in shukotsu(folder, "check").stdout
    early = shukotsu(folder, "report")
    assert (early.returncode, early.stdout) == (2, "")
    assert "does not exist yet; run `shukotsu run study.yaml` in this folder first" in early.stderr
    assert "does not exist yet" in shukotsu(folder, "export", "--formats", "csv", "--out", "out").stderr

    planned = shukotsu(folder, "run", "--dry-run")
    assert planned.returncode == 0
    one_table = shukotsu(folder, "run", "--dry-run", "--", "results/piano/joint_centres.parquet")
    assert one_table.returncode == 0, one_table.stderr
    assert not (folder / "results" / "piano" / "report.html").exists()

    done = shukotsu(folder, "run", "--cores", "2")
    assert done.returncode == 0, done.stderr
    command = done.stderr.partition("\n")[0]
    assert command.startswith("$ ")
    assert command.endswith("--configfile study.yaml --quiet reason --cores 2")
    first, *_, last = done.stdout.splitlines()
    assert first.startswith("Study piano: 1 of 1 recording used")
    assert last == "report: results/piano/report.html"

    printed = shukotsu(folder, "report", "--print").stdout
    assert printed.startswith("Study piano: 1 of 1 recording used.")
    assert printed.endswith("\nresults/piano/report.html\n")
    exported = shukotsu(folder, "export", "study.yaml", "--formats", "csv", "--out", "out")
    assert exported.returncode == 0, exported.stderr
    assert (folder / "out" / "sub-01_hand-right_task-rom_model-rigid.csv").is_file()


ENDS = [(os.killpg, signal.SIGINT, 130), (os.kill, signal.SIGTERM, 143), (os.killpg, signal.SIGHUP, 129)]
"""Signals as they arrive, at the group from a terminal, and exit codes; others in commands/test_run_study."""


@pytest.mark.parametrize("after", ["$ ", " jobs done"])
def test_an_interrupted_run_leaves_no_process(tmp_path: Path, after: str) -> None:
    """It is interrupted while Snakemake starts or between jobs; the same command then completes the run."""
    file = record(tmp_path / "rom.parquet")
    study = write_study(tmp_path, "study", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"])
    words = ("run", "--", (study.results.subject("01") / "tips.parquet").relative_to(tmp_path).as_posix())
    mark = {"OF_THIS_TEST": str(tmp_path)}
    for kill, number, code in ENDS:
        shutil.rmtree(study.results.folder, ignore_errors=True)  # so that there are jobs to do
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "shukotsu", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)} | mark,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            text=True,
        )
        assert process.stderr is not None
        assert any(after in line for line in process.stderr)
        kill(process.pid, number)
        said = [line for line in process.communicate()[1].splitlines() if line.startswith(("error", "Work"))]
        assert process.returncode == code
        assert len(said) == 1
        assert said[0].startswith("error: ")
        environments = (each.info["environ"] or {} for each in psutil.process_iter(["environ"]))
        assert not [each for each in environments if each.get("OF_THIS_TEST") == str(tmp_path)]
    assert shukotsu(tmp_path, *words).returncode == 0


def test_a_run_that_cannot_continue_states_one_reason(tmp_path: Path) -> None:
    """A damaged table is reported with its job and log; an unwritable results folder gives exit code 2."""
    file = record(tmp_path / "rom.parquet")
    study = write_study(tmp_path, "study", [f"01\tright\trom\tboth\t{file.name}"], ["rigid"])
    table = study.results.subject("01") / "joint_solutions.parquet"
    assert (
        shukotsu(tmp_path, "run", "--cores", "2", "--", table.relative_to(tmp_path).as_posix()).returncode
        == 0
    )
    state = table.stat()
    table.write_bytes(table.read_bytes()[:2000])
    os.utime(table, ns=(state.st_atime_ns, state.st_mtime_ns))
    target = (table.parent / "projected_joints.parquet").relative_to(tmp_path).as_posix()
    failed = shukotsu(tmp_path, "run", "--", target)
    assert failed.returncode == 1
    (sentence,) = [line for line in failed.stderr.splitlines() if line.startswith("error: ")]
    assert sentence.startswith(
        "error: project_planes: subject 01: results/study/sub-01/joint_solutions.parquet: "
    )
    assert sentence.endswith("(log: results/study/logs/project_planes/sub-01.log)")
    assert "remove it and run the study again" in sentence
    assert "CalledProcessError" not in failed.stderr
    table.parent.chmod(0o555)
    if os.access(table.parent, os.W_OK):
        pytest.skip("permissions do not bind this user")
    refused = shukotsu(tmp_path, "run", "--", target)
    table.parent.chmod(0o755)
    assert refused.returncode == 2
    assert "results/study/sub-01: cannot be written" in refused.stderr.splitlines()[-1]
