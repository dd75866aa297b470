"""Jobs open only files that their rules declare, and whatever changed is made again."""

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
from program_files import BESIDE, REPOSITORY
from sample_files import RECORDINGS, midi_of
from studies.running import SHORT_FIT, Job, StudyRun, copy_of_the_program, hashes, record, write_study

from shukotsu import job
from shukotsu.errors import InputError
from shukotsu.study.results import FIT_TABLES, SUBJECT_TABLES
from shukotsu.workflow.study_files import StudyFiles

pytestmark = pytest.mark.slow

CONFIGURED = {"plan"}
"""Rules with the content of the study file and its sheets as a parameter."""
OF_THE_STUDY = ("gather", "compare_models", "compare_movement", "export_dataset", "report", "print_figures")
"""Rules that read the study file and its sheets."""
RULES = re.findall(r"(?m)^(?:use rule \w+ as|rule) (\w+)", (REPOSITORY / "Snakefile").read_text("utf-8"))
EVERYTHING = {*RULES} - {"all", "plan", "simulate", "stream"}
"""Rules that run again after a change of the program: not plans, written when a run begins, nor
simulations.
"""
UP_TO_JOINTS = {"plan", "capture", "check_recordings", "solve_joints"}
NEEDED = {
    "sub-01/fits/right/fitted/receivers.parquet": UP_TO_JOINTS - {"solve_joints"} | {"fit_hands"},
    "sub-01/tips.parquet": UP_TO_JOINTS
    | {"project_planes", "fit_hands", "estimate_metacarpals", "evaluate_tips"},
}
"""Rules that are needed to make a table."""
FRAMES = 700  # a CSV file over 1 MB, above which Snakemake checks modification times
Command = tuple[str, ...]


def every_format(folder: Path) -> list[str]:
    """Write a recording of each format, the capture with events; return their rows of the sheet."""
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


def written_study(base: Path) -> StudyRun:
    """Write a study with all kinds of sheets and recordings beside a copy of the program."""
    program, folder = copy_of_the_program(base / "the program"), base / "study"
    folder.mkdir()
    rows = ["subject\thand\ttask\trole\tfile\tmapping\tevents\tpulses", *every_format(folder)]
    record(folder / "01.csv", frames=FRAMES)
    record(folder / "left.parquet", hand="left")
    record(folder / "02.parquet", subject="02")
    rows += ["01\tright\trom\tboth\t01.csv\t\t\t", "01\tleft\trom\tboth\tleft.parquet\t\t\t"]
    rows += ["02\tright\trom\tboth\t02.parquet\t\t\t", "02\tleft\trom\tboth\tmissing.csv\t\t\t"]
    (folder / "corrections.tsv").write_text(
        "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tring_dip\t1\t0\t0\n"
    )
    (folder / "participants.tsv").write_text("subject\tgroup\n01\ta\n02\tb\n")
    (folder / "events.tsv").write_text("subject\thand\ttask\tonset_s\tname\n01\tright\trom\t0.5\ttap\n")
    for name in ("fitted", "another"):
        (folder / f"{name}.yaml").write_text(SHORT_FIT.replace("fitted", name, 1))
    sheets = {name: f"{name}.tsv" for name in ("corrections", "participants", "events")}
    models = ["paper-fig4", "paper-fig4-corrected", "fitted.yaml"]
    study = write_study(folder, "open", rows, models, exports="[bvh, bids, csv]", factors="[group]", **sheets)
    return replace(study, repository=program)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> tuple[StudyRun, Mapping[Command, set[Path]]]:
    """The finished study, and the files below its folder that each job opened, by the job's command."""
    study = written_study(tmp_path_factory.mktemp("reruns") / "base")
    with (
        TemporaryDirectory() as folder,  # a socket's path must be short
        socket.socket(socket.AF_UNIX) as listener,
        pytest.MonkeyPatch.context() as patch,
    ):
        address, listed = str(Path(folder, "jobs")), Path(folder, "opened.jsonl")
        listener.bind(address)
        listener.listen(128)
        environment = os.environ | {"PYTHONPATH": str(study.repository), "OMP_NUM_THREADS": "1"}
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
    return study, {
        tuple(line["argv"]): {path for path in map(Path, line["opened"]) if study.folder in path.parents}
        for line in lines
    }


@pytest.fixture(scope="module")
def study(watched: tuple[StudyRun, object]) -> StudyRun:
    return watched[0]


@pytest.fixture(scope="module")
def opened(watched: tuple[object, Mapping[Command, set[Path]]]) -> Mapping[Command, set[Path]]:
    return watched[1]


@pytest.fixture(scope="module")
def declared(study: StudyRun) -> dict[Command, tuple[str, set[Path]]]:
    """Each job's rule and its input, output and log files by its command, as listed by a dry run."""
    with TemporaryDirectory() as program:
        for name in ("shukotsu", *BESIDE[1:]):
            Path(program, name).symlink_to(study.repository / name)
        text = (study.repository / "Snakefile").read_text("utf-8")
        text += "for each in workflow.rules:\n    each.message = None\n"  # else files are not shown
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
        jobs[argv] = rule[1], {study.folder / name for line in files for name in line.split(", ")}
    return jobs


def undeclared(
    opened: Mapping[Command, set[Path]], jobs: Mapping[Command, tuple[str, set[Path]]]
) -> dict[str, set[Path]]:
    """Return, by rule, the files that jobs opened although the rule declares neither them nor their
    folder.
    """
    hidden: dict[str, set[Path]] = {}
    for argv, paths in opened.items():
        rule, files = jobs[argv]
        for path in paths:
            passing = path.name.endswith(".tmp") or path.is_dir()  # temporary, or a folder
            if not passing and rule not in CONFIGURED and not files & {path, *path.parents}:
                hidden.setdefault(rule, set()).add(path)
    return hidden


def test_every_job_opens_only_what_its_rule_declares(
    opened: Mapping[Command, set[Path]], declared: dict[Command, tuple[str, set[Path]]]
) -> None:
    assert opened.keys() == declared.keys()
    assert any(path.name == "plan.json" for path in set().union(*opened.values()))
    assert undeclared(opened, declared) == {}


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
def test_an_undeclared_input_is_found(
    opened: Mapping[Command, set[Path]], declared: dict[Command, tuple[str, set[Path]]], rule: str, name: str
) -> None:
    jobs = {
        argv: (other, {path for path in files if other != rule or path.name != name})
        for argv, (other, files) in declared.items()
    }
    assert undeclared(opened, jobs).keys() == {rule}


def digests(study: StudyRun) -> dict[str, set[str]]:
    """Return, by rule, the digests by which Snakemake notices changes of the user's files."""
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


def test_a_changed_byte_of_an_input_is_noticed(
    study: StudyRun,
    opened: Mapping[Command, set[Path]],
    declared: dict[Command, tuple[str, set[Path]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The size and time of the file stay the same; the job's rule notices the change or the file is
    refused.
    """
    monkeypatch.chdir(study.folder)
    before = digests(study)
    inputs: dict[Path, set[str]] = {}
    for argv, paths in opened.items():
        for path in paths:
            if path.is_file() and path.relative_to(study.folder).parts[0] not in ("results", ".snakemake"):
                inputs.setdefault(path, set()).add(declared[argv][0])
    assert len(inputs) > len(RECORDINGS) + 10
    unseen = []
    for path, rules in inputs.items():
        original = path.with_name(f".original {path.name}")
        shutil.copy2(path, original)
        content, state = bytearray(path.read_bytes()), path.stat()
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
        os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))
        with suppress(InputError):
            after = digests(study)
            unseen += [(rule, path.name) for rule in rules if before[rule] == after[rule]]
        original.replace(path)
    assert unseen == []
    assert digests(study) == before


def test_every_table_is_declared_to_snakemake(study: StudyRun) -> None:
    """All tables in the results folder are listed by `--summary`."""
    done = study.snakemake("--summary")
    assert done.returncode == 0, done.stderr
    listed = {line.split("\t")[0] for line in done.stdout.splitlines()[1:]}
    tables = {path.relative_to(study.folder).as_posix() for path in study.results.folder.rglob("*.parquet")}
    assert tables <= listed
    names = Counter(path.stem for path in study.results.subject("01").rglob("*.parquet"))
    # Two hands, each with the fitted model and the reference hand.
    assert names == Counter([*SUBJECT_TABLES]) + Counter({"poses": 2, **dict.fromkeys(FIT_TABLES, 4)})


def test_snakemakes_report_can_be_made(study: StudyRun, tmp_path: Path) -> None:
    """The dependencies of `snakemake --report` are in the lock file."""
    done = study.snakemake("--report", str(tmp_path / "workflow.html"))
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "workflow.html").read_text("utf-8")
    assert "solve_joints" in page
    caption = (study.results.figures / "joint-trust.txt").read_text("utf-8")
    assert caption.partition(":")[0] in page


@pytest.fixture(scope="module")
def copy(study: StudyRun, tmp_path_factory: pytest.TempPathFactory) -> StudyRun:
    """A copy of the study and its program at another depth, with new modification times."""
    base = tmp_path_factory.mktemp("deeper") / "and" / "copy"
    shutil.copytree(study.folder.parent, base, copy_function=shutil.copyfile)
    return StudyRun(base / "study" / study.file.name, base / "study", base / study.repository.name)


def rules(jobs: set[Job]) -> set[str]:
    return {job.rule for job in jobs}


def subjects(jobs: set[Job]) -> set[str]:
    return {job.subject for job in jobs if job.subject is not None}


def test_a_copied_study_needs_no_job(copy: StudyRun) -> None:
    """A second run does nothing, and needs no job even without Snakemake's metadata."""
    assert "Nothing to be done" in copy.run()
    memory = copy.folder / ".snakemake"
    memory.rename(copy.folder.parent / "memory")
    assert copy.planned() == set()
    shutil.rmtree(memory)
    (copy.folder.parent / "memory").rename(memory)


def test_a_requested_table_is_made_with_its_dependencies_only(copy: StudyRun) -> None:
    results = copy.results.folder
    results.rename(copy.folder / "results" / "aside")
    for table, needed in NEEDED.items():
        jobs = copy.planned(f"results/open/{table}")
        assert rules(jobs) == needed
        assert subjects(jobs) == {"01"}
    assert rules(copy.planned("--until", f"results/open/{table}")) >= needed
    shutil.rmtree(results, ignore_errors=True)
    (copy.folder / "results" / "aside").rename(results)


def test_a_changed_program_reruns_everything_but_the_plans(copy: StudyRun) -> None:
    module = copy.repository / "shukotsu/paper/plane.py"
    text = module.read_text("utf-8")
    module.write_text(f"{text}\nassert True\n", "utf-8")
    jobs = copy.planned()
    assert rules(jobs) == EVERYTHING
    assert subjects(jobs) == {"01", "02", "all"}
    module.write_text(text, "utf-8")


def test_changes_are_rerun_with_the_results_of_a_fresh_run(copy: StudyRun) -> None:
    """Changes: an exchanged recording, an additional model, other participants and a removed subject."""
    results = copy.results.folder
    fits = results / "sub-02" / "fits" / "right" / "fitted"
    times_ns = {path: path.stat().st_mtime_ns for path in fits.iterdir()}
    before = hashes(results)
    record(copy.folder / "01.csv", frames=FRAMES - 20)
    jobs = copy.planned()
    assert rules(jobs) == EVERYTHING - {"fit_hand"}, "one job fits both hands"
    assert subjects(jobs) == {"01"}

    copy.file.write_text(copy.file.read_text("utf-8").replace("models: [", "models: [another.yaml, "))
    jobs = copy.planned()
    refitted = {job.about for job in jobs if job.rule.startswith("fit_hand") and job.subject != "01"}
    assert refitted == {f"subject {fitted}, model another" for fitted in ("02", "all, right hand")}
    assert subjects({job for job in jobs if job.rule in UP_TO_JOINTS - {"plan", "solve_joints"}}) == {"01"}

    (copy.folder / "participants.tsv").write_text("subject\tgroup\n01\tb\n02\tb\n")
    copy.file.write_text(copy.file.read_text("utf-8").replace("[bvh, bids, csv]", "[bvh]"))
    for name in (copy.file.name, "participants.tsv", "01.csv"):  # a clock ahead
        path = copy.folder / name
        os.utime(path, (path.stat().st_mtime + 86400,) * 2)
    sheet = copy.folder / "open.tsv"
    lines = sheet.read_text("utf-8").splitlines(keepends=True)
    sheet.write_text("".join(line for line in lines if not line.startswith("all\t")))
    notes = results / "sub-all" / "notes.txt"
    notes.write_text("the user's own")
    text = copy.run()
    assert "changed since the last run: " in text
    assert "removed results that no longer belong to the study: dataset, tidy, sub-all" in text
    assert [path for path in notes.parent.rglob("*") if path.is_file()] == [notes]
    notes.unlink()
    after = hashes(results)
    changed = {name for name in before.keys() & after.keys() if after[name] != before[name]}
    assert changed >= {"report.html", "tip_errors.parquet", "sub-01/right/rom/poses.parquet"}
    assert not [name for name in changed if name.startswith(("sub-02/right/", "sub-02/fits/"))]
    assert {path: path.stat().st_mtime_ns for path in fits.iterdir()} == times_ns
    assert {row["model"] for row in copy.rows("receivers")} == {"fitted", "another"}
    assert copy.planned() == set()

    shutil.rmtree(results)
    copy.run()
    assert hashes(results) == after


def test_damaged_results_are_made_again(copy: StudyRun) -> None:
    """Results are truncated with their times kept, removed, or without metadata; the remade files are
    identical.
    """
    results = copy.results.folder
    before = hashes(results)
    for name in ("report.html", "sub-02/plan.json", "sub-02/findings.parquet", "sub-01/tips.parquet"):
        file = results / name
        state = file.stat()
        os.truncate(file, state.st_size // 2)
        os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    (results / "sub-02/joint_centres.parquet").unlink()
    remade = {"check_recordings", "estimate_metacarpals", "evaluate_tips", "gather", "report"}
    assert remade <= rules(copy.planned())
    assert copy.planned("results/open/sub-02/right/rom/poses.parquet") == set(), "and no other target"
    assert "note: results changed after their run, now made again: " in copy.run()
    assert hashes(results) == before
    assert copy.planned() == set()
    (results / "logs" / "made_from.json").unlink()
    assert copy.planned() == set()
    shutil.rmtree(copy.folder / ".snakemake")
    assert {"capture", "solve_joints", "report"} <= rules(copy.planned()), "nothing records what made them"
