"""What each job of a study opens is what its rule declares, and known by its content: nothing is hidden."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
from program_files import BESIDE
from sample_files import RECORDINGS, midi_of
from studies.running import REPOSITORY, StudyRun, hashes, record, write_study

from shukotsu import job
from shukotsu.errors import InputError
from shukotsu.workflow.study_files import StudyFiles

pytestmark = pytest.mark.slow

CONFIGURED = {"plan"}
"""Rules of which the content of the study file and its sheets is a parameter."""
OF_THE_STUDY = ("gather", "compare_models", "compare_movement", "export_dataset", "report", "print_figures")
"""Rules that read the study file and its sheets."""
Command = tuple[str, ...]


def every_format(folder: Path) -> list[str]:
    """Write a recording of each format, the capture with events; give rows of the sheet."""
    pulses = f"{midi_of(folder, np.arange(3) / 100).name}\tnote 24 = sync"
    rows = []
    for name, sample in RECORDINGS.items():
        recording, task, mapping = sample(), name.replace(" ", "-"), ""
        (folder / task).mkdir()
        (folder / task / recording.path).write_bytes(recording.content)
        if recording.mapping is not None:
            mapping = f"{task}.yaml"
            (folder / mapping).write_text(json.dumps(recording.mapping))
        events = pulses if name == "capture" else "\t"
        rows.append(f"all\tright\t{task}\tboth\t{task}/{recording.path}\t{mapping}\t{events}")
    return rows


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """A study with sheets and recordings of all kinds, simulated truth apart."""
    folder = tmp_path_factory.mktemp("declared")
    rows = ["subject\thand\ttask\trole\tfile\tmapping\tevents\tpulses", *every_format(folder)]
    for subject in ("01", "02"):
        record(folder / f"{subject}.parquet", subject=subject)
        rows.append(f"{subject}\tright\trom\tboth\t{subject}.parquet\t\t\t")
    record(folder / "left.parquet", subject="01", hand="left")
    rows += ["01\tleft\trom\tboth\tleft.parquet\t\t\t", "02\tleft\trom\tboth\tmissing.csv\t\t\t"]
    (folder / "corrections.tsv").write_text(
        "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t1\t0\t0\n"
    )
    (folder / "participants.tsv").write_text("subject\tgroup\n01\ta\n02\tb\n")
    (folder / "events.tsv").write_text("subject\thand\ttask\tonset_s\tname\n01\tright\trom\t0.5\ttap\n")
    (folder / "fitted.yaml").write_text(
        "model: fitted\ndescription: a short fit\njoints: {calibration: all}\n"
        "planes: {cut: false}\nfit: {whole_hand: true, frames: 40, steps: 1}\n"
        "metacarpals: {unmeasured: fitted, measured: fitted}\n"
    )
    sheets = {name: f"{name}.tsv" for name in ("corrections", "participants", "events")}
    models = ["paper-fig4", "paper-fig4-corrected", "fitted.yaml"]
    return write_study(folder, "open", rows, models, exports="[bvh, bids, csv]", factors="[group]", **sheets)


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
    """Return every job's rule and input, output and log files, by its command, as a dry run lists them."""
    with TemporaryDirectory() as program:
        for name in ("shukotsu", *BESIDE[1:]):
            Path(program, name).symlink_to(REPOSITORY / name)
        text = (REPOSITORY / "Snakefile").read_text("utf-8")
        text += "for each in workflow.rules:\n    each.message = None\n"  # shown are either messages or files
        Path(program, "Snakefile").write_text(text, "utf-8")
        done = replace(study, repository=Path(program)).snakemake(
            "--dry-run", "--forceall", "--printshellcmds"
        )
    assert done.returncode == 0, done.stderr
    jobs = {}
    for block in re.split(r"\n\n(?=\[)", done.stdout + done.stderr):
        command = re.search(r'"\$SHUKOTSU_STAGES"/(\w+\.py .*)$', block, re.MULTILINE)
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
    """Return the files that jobs opened and that are no file, nor in a folder, that their rules declare."""
    hidden: dict[str, set[str]] = {}
    for argv, paths in opened.items():
        rule, files = jobs[argv]
        for path in paths:
            passing = path.name.endswith(".tmp") or path.is_dir()  # half written, or a folder's names
            if not passing and rule not in CONFIGURED and not files & {path, *path.parents}:
                hidden.setdefault(rule, set()).add(path.relative_to(study.folder).as_posix())
    return hidden


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
        argv: (other, {path for path in files if other != rule or path.name != name})
        for argv, (other, files) in declared(study).items()
    }
    assert undeclared(opened, jobs, study).keys() == {rule}


def digests(study: StudyRun) -> dict[str, set[str]]:
    """Give, by rule, what tells Snakemake whether the user's files are what they were."""
    files = StudyFiles(study.file)
    each = [
        SimpleNamespace(subject=plan.who.token, hand=recording.hand.hand, recording=recording.name)
        for plan in files.subjects
        for recording in plan.recordings
    ]
    return {
        "plan": set(map(files.plan, each)),
        "capture": set(map(files.recording_digest, each)),
        "align_events": set(map(files.event_digest, each)),
        **{rule: {files.configuration_digest} for rule in OF_THE_STUDY},
    }


def other_content(path: Path) -> None:
    """Change one byte, and nothing that the file system lets a program set."""
    content, before = bytearray(path.read_bytes()), path.stat()
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_an_input_is_known_by_its_content(
    study: StudyRun, opened: Mapping[Command, set[Path]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of every file of the user's that a job opened, a change is seen by its rule, or refused at once."""
    monkeypatch.chdir(study.folder)
    jobs, before = declared(study), digests(study)
    inputs: dict[Path, set[str]] = {}
    for argv, paths in opened.items():
        for path in paths:
            if path.is_file() and path.relative_to(study.folder).parts[0] not in ("results", ".snakemake"):
                inputs.setdefault(path, set()).add(jobs[argv][0])
    assert len(inputs) > len(RECORDINGS) + 10
    unseen = []
    for path, rules in inputs.items():
        kept = path.with_name(f".kept {path.name}")
        shutil.copy2(path, kept)
        other_content(path)
        with suppress(InputError):
            after = digests(study)
            unseen += [(rule, path.name) for rule in rules if before[rule] == after[rule]]
        kept.replace(path)
    assert unseen == []
    assert digests(study) == before


def test_what_is_made_again_is_what_a_fresh_run_makes(study: StudyRun, tmp_path: Path) -> None:
    """After exchanged recordings, other participants and a subject less."""
    copy = StudyRun(tmp_path / "open" / study.file.name, tmp_path / "open")
    shutil.copytree(study.folder, copy.folder)
    (copy.folder / "01.parquet").rename(copy.folder / "right.parquet")
    (copy.folder / "left.parquet").rename(copy.folder / "01.parquet")
    (copy.folder / "right.parquet").rename(copy.folder / "left.parquet")
    (copy.folder / "participants.tsv").write_text("subject\tgroup\n01\tb\n")
    rows = (copy.folder / "open.tsv").read_text("utf-8").splitlines(keepends=True)
    (copy.folder / "open.tsv").write_text("".join(row for row in rows if not row.startswith("02\t")))
    notes = copy.folder / "results" / "open" / "sub-02" / "notes.txt"
    notes.write_text("the user's own")

    said = copy.run()
    assert "changed since the last run: " in said
    assert "removed results of what the study has no longer: sub-02" in said
    left = [path for path in notes.parent.rglob("*") if path.is_file()]
    assert left == [notes]
    notes.unlink()
    again = hashes(copy.results.folder)
    shutil.rmtree(copy.results.folder)
    copy.run()
    assert hashes(copy.results.folder) == again
