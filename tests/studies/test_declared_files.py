"""What each job of a study opens is what its rule declares: nothing is hidden from Snakemake."""

from __future__ import annotations

import json
import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from studies.running import REPOSITORY, StudyRun, record, write_study

from shukotsu.workflow import job

pytestmark = pytest.mark.slow

CONFIGURED = {"plan"}
"""Rules of which the content of the study file and its sheets is a parameter."""
Command = tuple[str, ...]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """A study of two subjects with sheets of all kinds, simulated truth apart."""
    folder = tmp_path_factory.mktemp("declared")
    rows = ["subject\thand\ttask\trole\tfile"]
    for subject in ("01", "02"):
        record(folder / f"{subject}.parquet", subject=subject)
        rows.append(f"{subject}\tright\trom\tboth\t{subject}.parquet")
    record(folder / "left.parquet", subject="01", hand="left")
    rows += ["01\tleft\trom\tboth\tleft.parquet", "02\tleft\trom\tboth\tmissing.csv"]
    (folder / "corrections.tsv").write_text(
        "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t1\t0\t0\n"
    )
    (folder / "participants.tsv").write_text("subject\tgroup\n01\ta\n02\tb\n")
    (folder / "events.tsv").write_text("subject\thand\ttask\tonset_s\tname\n01\tright\trom\t0.5\ttap\n")
    (folder / "fitted.yaml").write_text(
        "model: fitted\ndescription: a short fit\njoints: {solver: anatomical, calibration: all}\n"
        "planes: {cut: false}\nfit: {whole_hand: true, frames: 40, steps: 1}\n"
        "metacarpals: {unmeasured: fitted, measured: fitted}\n"
    )
    sheets = {name: f"{name}.tsv" for name in ("corrections", "participants", "events")}
    models = ["paper-fig4", "paper-fig4-corrected", "fitted.yaml"]
    return write_study(folder, "open", rows, models, exports="[bvh, bids]", factors="[group]", **sheets)


@pytest.fixture(scope="module")
def opened(study: StudyRun) -> Mapping[Command, set[Path]]:
    """Run the study; give what each job opened below the study's folder, by its command."""
    with (
        TemporaryDirectory() as folder,  # a socket's path must be short
        socket.socket(socket.AF_UNIX) as listener,
        pytest.MonkeyPatch.context() as patch,
    ):
        address, listed = str(Path(folder, "jobs")), Path(folder, "opened.jsonl")
        listener.bind(address)
        listener.listen(128)
        environment = os.environ | {"PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
        script = Path(__file__).with_name("opening_jobs.py")
        server = subprocess.Popen(
            [sys.executable, str(script), str(listener.fileno()), str(listed)],
            stdin=subprocess.PIPE,
            pass_fds=[listener.fileno()],
            env=environment,
        )
        patch.setenv(job.ADDRESS, address)
        study.run()
        server.communicate()
        lines = [json.loads(line) for line in listed.read_text("utf-8").splitlines()]
    return {
        tuple(line["argv"]): {path for path in map(Path, line["opened"]) if study.folder in path.parents}
        for line in lines
    }


def declared(study: StudyRun) -> dict[Command, tuple[str, set[Path]]]:
    """Give every job's rule and its input, output and log files, by its command, as a dry run lists them."""
    with TemporaryDirectory() as program:
        for name in ("shukotsu", "config", "captions", "profiles"):
            Path(program, name).symlink_to(REPOSITORY / name)
        text = (REPOSITORY / "Snakefile").read_text("utf-8")
        without = re.sub(r"    message:\n.*\n", "", text)  # Snakemake shows either a message or the files
        Path(program, "Snakefile").write_text(without, "utf-8")
        done = replace(study, repository=Path(program)).snakemake(
            "--dry-run", "--forceall", "--printshellcmds"
        )
    assert done.returncode == 0, done.stderr
    jobs = {}
    for block in re.split(r"\n\n(?=\[)", done.stdout + done.stderr):
        command = re.search(r"-m shukotsu\.workflow\.job (.*)$", block, re.MULTILINE)
        rule = re.search(r"^(?:local)?rule (\w+):", block, re.MULTILINE)
        if command is None or rule is None:
            continue
        words = shlex.split(command[1])
        argv = tuple(words[: next((at for at, word in enumerate(words) if word in (">", "2>")), len(words))])
        files = re.findall(r"^    (?:input|output|log): (.*)$", block, re.MULTILINE)
        paths = {study.folder / name for line in files for name in line.split(", ")}
        jobs[argv] = rule[1], paths
    return jobs


def undeclared(
    opened: Mapping[Command, set[Path]], jobs: Mapping[Command, tuple[str, set[Path]]], study: StudyRun
) -> dict[str, set[str]]:
    """Give the files that jobs opened and that are no file, nor in a folder, that their rules declare."""
    found: dict[str, set[str]] = {}
    for argv, paths in opened.items():
        rule, known = jobs[argv]
        for path in paths:
            own = (
                path.name.endswith(".tmp") or path.is_dir()
            )  # half written, and a folder's names on the disk
            if not own and rule not in CONFIGURED and not known & {path, *path.parents}:
                found.setdefault(rule, set()).add(path.relative_to(study.folder).as_posix())
    return found


def test_every_job_opens_what_its_rule_declares(study: StudyRun, opened: Mapping[Command, set[Path]]) -> None:
    jobs = declared(study)
    assert opened.keys() == jobs.keys()
    assert any(path.name == "plan.json" for path in set().union(*opened.values()))
    assert undeclared(opened, jobs, study) == {}


@pytest.mark.parametrize(
    ("rule", "name"),
    [
        ("measure_movement", "events.parquet"),
        ("fit_hand", "findings.parquet"),
        ("solve_joints", "poses.parquet"),
        ("subject_pages", "poses.parquet"),
        ("report", "problems.parquet"),
    ],
)
def test_an_input_that_a_rule_leaves_out_is_found(
    study: StudyRun, opened: Mapping[Command, set[Path]], rule: str, name: str
) -> None:
    jobs = {
        argv: (own, {path for path in files if own != rule or path.name != name})
        for argv, (own, files) in declared(study).items()
    }
    assert undeclared(opened, jobs, study).keys() == {rule}
