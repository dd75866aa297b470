"""A small study through the Slurm profile and a real Slurm: the same bytes, whatever was killed on the way.

What is waited for most is Slurm itself: it looks every 30 s for jobs that are out of time, and a minute is
the least that it gives. That study therefore runs beside the others.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
from cluster.private_slurm import PrivateSlurm, missing
from studies.running import REPOSITORY, StudyRun, hashes, record, write_study

pytestmark = pytest.mark.slurm

Done = subprocess.CompletedProcess[str]
SNAKEFILE = REPOSITORY / "Snakefile"
PROFILE = ["--workflow-profile", str(REPOSITORY / "config" / "profiles" / "slurm")]
FASTER = ["--seconds-between-status-checks", "1", "--latency-wait", "15"]
ASKING = re.findall(r"^rule (\w+):(?:(?!^rule ).)*?resources:", SNAKEFILE.read_text("utf-8"), re.M | re.S)
"""Rules that say themselves how long they take."""
ONE_MINUTE = ["--default-resources", "mem_mb=500", "runtime=0"]
ONE_MINUTE += ["--set-resources", "subject_pages:runtime=1", "gather:runtime=5"]
ONE_MINUTE += [f"{rule}:runtime=0" for rule in ASKING if rule != "subject_pages"]
SLOW = (
    'case "$BASH_EXECUTION_STRING" in *stages.solve_joints\\ *) [ ! -f slow ] || sleep "$(cat slow)";; esac\n'
)
"""Read by every bash that runs a job: solve_joints waits the seconds in the study's file `slow`."""


@pytest.fixture(scope="module")
def slurm() -> Iterator[PrivateSlurm]:
    """Run a Slurm of this module's own, stopped whatever happens."""
    if reason := missing():
        pytest.skip(reason)
    with tempfile.TemporaryDirectory(prefix="slurm-") as name, pytest.MonkeyPatch.context() as patch:
        slowing = Path(name, "slowing.sh")
        slowing.write_text(SLOW, "utf-8")
        patch.setenv("BASH_ENV", str(slowing))
        private = PrivateSlurm(Path(name))
        try:
            private.start()
            yield private
        finally:
            private.stop()


@pytest.fixture(scope="module")
def out_of_time(
    slurm: PrivateSlurm, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Future[tuple[StudyRun, Done, Done]]]:
    """Start, in a thread, a study that is given a minute, which is too little, and then more."""
    study = _study(tmp_path_factory.mktemp("time") / "study", subjects=["01"], models=["paper-fig4"])

    def work() -> tuple[StudyRun, Done, Done]:
        (study.folder / "slow").write_text("300")
        cut_off = _through_slurm(study, *ONE_MINUTE)
        (study.folder / "slow").write_text("62")
        return study, cut_off, _through_slurm(study)

    with ThreadPoolExecutor(1) as pool:
        yield pool.submit(work)
    assert slurm.jobs() == []


@pytest.fixture(scope="module")
def local(out_of_time: object, tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """The study as it is on a laptop."""
    del out_of_time  # has begun by now
    study = _study(tmp_path_factory.mktemp("local") / "study")
    study.run()
    return study


def test_results_are_those_of_a_laptop_from_few_jobs(
    slurm: PrivateSlurm, local: StudyRun, tmp_path: Path
) -> None:
    """One Slurm job a subject and one for the study, and every byte the same."""
    study = _study(tmp_path / "study")
    done = _through_slurm(study)
    assert done.returncode == 0, done.stderr
    assert _states(slurm, study) == ["COMPLETED"] * 3
    assert hashes(study.results.folder) == hashes(local.results.folder)


def test_a_job_out_of_time_is_reported_and_finishes_with_more(
    slurm: PrivateSlurm, out_of_time: Future[tuple[StudyRun, Done, Done]]
) -> None:
    """The failure names the job and the stage's log; the same with the profile's own minutes ends well."""
    study, cut_off, finished = out_of_time.result()
    (killed,) = slurm.jobs("TIMEOUT", study.folder)
    assert cut_off.returncode == 1
    assert f"Slurm job {killed}: TIMEOUT (log: .snakemake/slurm/{killed}.log)" in cut_off.stderr
    assert "logs/solve_joints/sub-01.log" in cut_off.stderr
    assert "DUE TO TIME LIMIT" in _slurm_log(study, killed)
    assert finished.returncode == 0, finished.stderr
    assert sorted(_states(slurm, study)) == ["COMPLETED", "COMPLETED", "TIMEOUT"]


def _study(folder: Path, subjects: list[str] | None = None, models: list[str] | None = None) -> StudyRun:
    """Two subjects' right hands, a second of each of two tasks, and two models, unless less is asked for."""
    folder.mkdir(parents=True)
    rows = []
    for subject in subjects or ["01", "02"]:
        for task, role in (("rom", "calibration"), ("opposition", "evaluation")):
            file = record(folder / f"{subject}-{task}.parquet", subject=subject, task=task)
            rows.append(f"{subject}\tright\t{task}\t{role}\t{file.name}")
    return write_study(folder, "same", rows, models or ["paper-fig3-rest", "paper-fig4"])


def _through_slurm(study: StudyRun, *words: str) -> Done:
    return study.snakemake(*PROFILE, *FASTER, *words, cores=1)


def _states(slurm: PrivateSlurm, study: StudyRun) -> list[str]:
    return list(slurm.states(study.folder).values())


def _slurm_log(study: StudyRun, job: str) -> str:
    return (study.folder / ".snakemake" / "slurm" / f"{job}.log").read_text("utf-8")
