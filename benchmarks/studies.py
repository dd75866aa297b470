"""Whole studies of 1, 10 and 100 subjects: what they cost, where it goes, and what a change costs."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.text_table import Cell, TextTable
from schemas.config_files import tell_children
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.study import read_study

ROOT = Path(__file__).resolve().parent.parent
CORES = 2
SUBJECTS = (1, 10, 100)
FITTED_SUBJECTS = (4, 12)
SEED = 42
PAPER_STYLE = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected", "rigid")
ALL_MODELS = (*PAPER_STYLE, "anatomical", "whole-hand")
TASKS = (("rom", "calibration"), ("opposition", "evaluation"))
FRAMES = {"rom": 6000, "opposition": 3774}
HANDS = ("right", "left")
SIMULATED = ("01", "02")
"""Subjects that are simulated; the others' recordings are theirs under another name."""
OF_A_SUBJECT = (
    "capture",
    "check_calibration",
    "solve_joints",
    "project_planes",
    "fit_hand",
    "estimate_metacarpals",
    "evaluate_tips",
    "evaluate_skeletons",
)
PAGES = "subject_pages"
FORK = "fork"
_SPENT = re.compile(r"(\d+) made, \d+ up to date; ([\d.]+) of ([\d.]+) s of processor")
_MEASURED = """
import resource, subprocess, sys, time
started = time.perf_counter()
done = subprocess.run(sys.argv[1:], capture_output=True, text=True)
took = resource.getrusage(resource.RUSAGE_CHILDREN)
print(done.returncode, time.perf_counter() - started, took.ru_utime + took.ru_stime, took.ru_maxrss / 1024)
print((done.stdout + done.stderr)[-4000:])
"""
_NAMED = """
import json, runpy, sys
before = set(sys.modules)
sys.argv = sys.argv[1:]
try:
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
except SystemExit as end:
    assert not end.code, end.code
names = [name for name, module in sys.modules.items() if module and name not in before and name != "__main__"]
print("\\n" + json.dumps(names))
"""
"""Runs a module as a job does and prints what was imported, in that order."""
_IMPORTED = """
import contextlib, importlib, json, sys
names = json.loads(sys.argv[1])
if "pandas" not in names:  # a job may keep it out, see stages.command_line
    from stages import command_line
    command_line.begin()
for name in names:
    with contextlib.suppress(ImportError, AttributeError, KeyError):
        importlib.import_module(name)
"""


@dataclass(frozen=True)
class Cost:
    """Seconds by the clock and of the processors, of all processes together; MB of the largest process."""

    seconds: float
    processor_s: float
    largest_mb: float


@dataclass(frozen=True)
class Stage:
    """One stage over a study: jobs, processor seconds of all, and those to start and import one."""

    name: str
    jobs: int
    processor_s: float
    start_s: float

    @property
    def work_s(self) -> float:
        """Processor seconds in arithmetic, reading and writing."""
        return self.processor_s - self.jobs * self.start_s


@dataclass(frozen=True)
class Study:
    """A study's file and the folder that it runs in."""

    folder: Path
    subjects: int
    models: Sequence[str]

    @property
    def file(self) -> Path:
        """The study file."""
        return self.folder / "many.yaml"

    @property
    def results(self) -> Path:
        """Where its results are."""
        return self.folder / "results" / "many"

    def write(self, recordings: Path, subjects: int | None = None) -> None:
        """Write the study file and its sheet, for so many subjects."""
        self.folder.mkdir(parents=True, exist_ok=True)
        rows = ["subject\thand\ttask\trole\tfile"]
        for index in range(subjects or self.subjects):
            own = self.folder / "recordings" / f"{index:04}"
            for hand in HANDS:
                for task, role in TASKS:
                    source = recordings / f"{SIMULATED[index % len(SIMULATED)]}_{hand}_{task}.parquet"
                    file = own / f"{hand}_{task}.parquet"
                    if not file.exists():
                        own.mkdir(parents=True, exist_ok=True)
                        os.link(source, file)
                    rows.append(f"{index:04}\t{hand}\t{task}\t{role}\t{file.relative_to(self.folder)}")
        (self.folder / "many.tsv").write_text("\n".join(rows) + "\n", "utf-8")
        words = f"study: many\nrecordings: many.tsv\nlayout: liberty16\nmodels: [{', '.join(self.models)}]\n"
        self.file.write_text(words, "utf-8")

    def run(self) -> Cost:
        """Run the workflow; RuntimeError where it fails."""
        words = ["-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--directory", str(self.folder)]
        return measure([*words, "--configfile", str(self.file), "--cores", str(CORES), "--quiet", "all"])


def run(subjects: Sequence[int] = SUBJECTS) -> Iterator[TextTable]:
    """Give the tables; studies of so many subjects, the last one also changed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recordings = _simulated(folder / "simulated")
        studies = [Study(folder / f"{count}", count, PAPER_STYLE) for count in subjects]
        rows: list[tuple[Cell, ...]] = []
        starts: dict[str, float] = {}
        for study in studies:
            study.write(recordings)
            cost = study.run()
            starts = starts or _starts(study)
            stages = _stages(study, starts)
            rows.append(_row(f"{study.subjects} subjects, cold", study, cost, stages))
        last = studies[-1]
        rows.append(_row("again, nothing changed", last, last.run()))
        last.write(recordings, last.subjects + 1)
        rows.append(_row("one subject more", last, last.run()))
        yield _whole(rows)
        yield _by_stage(last, stages)
        whole = [Study(folder / f"fitted-{count}", count, ALL_MODELS) for count in FITTED_SUBJECTS]
        yield _seven([_fitted_row(study, recordings) for study in whole])


def measure(words: Sequence[str]) -> Cost:
    """Run a Python process with these words; RuntimeError where it fails."""
    command = [sys.executable, "-c", _MEASURED, sys.executable, *words]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT, env=environment)
    first, _, said = done.stdout.partition("\n")
    code, *cost = first.split()
    if code != "0":
        raise RuntimeError(f"python {' '.join(words)} ended with {code}:\n{said}")
    return Cost(*map(float, cost))


def _simulated(folder: Path) -> Path:
    """Simulate both tasks of both hands of two subjects, in full length."""
    for subject in SIMULATED:
        for hand in HANDS:
            for task, _ in TASKS:
                words = [f"--subject={subject}", f"--hand={hand}", f"--task={task}", f"--seed={SEED}"]
                out = folder / f"{subject}_{hand}_{task}.parquet"
                measure(["-m", "stages.simulate", *words, f"--frames={FRAMES[task]}", f"--out={out}"])
    return folder


def _stages(study: Study, starts: Mapping[str, float]) -> list[Stage]:
    """What each stage took in a study that was just run; starts : of a process, by what it runs."""
    stages = []
    for name in OF_A_SUBJECT:
        logs = sorted((study.results / "logs" / name).rglob("*.log"))
        spent = [_SPENT.search(log.read_text("utf-8")) for log in logs]
        processor_s = sum(float(found[3]) for found in spent if found is not None)
        if logs:
            stages.append(Stage(name, len(logs), processor_s + len(logs) * starts[FORK], starts[FORK]))
    for name, (words, jobs) in _at_the_end(study).items():
        work_s = jobs * (measure(words).processor_s - starts[name])
        start_s = starts[FORK if name == PAGES else name]
        stages.append(Stage(name, jobs, work_s + jobs * start_s, start_s))
    return stages


def _at_the_end(study: Study) -> dict[str, tuple[list[str], int]]:
    """Words and number of the jobs that are not run by `stages.each`; what they write goes elsewhere."""
    whole = ["--study", str(study.file), "--results", str(study.results)]
    out = study.folder / "again"
    return {
        PAGES: (
            ["-m", "stages.report.subject", *whole, "--subject=0000", f"--out={out}"],
            study.subjects,
        ),
        "gather": (["-m", "stages.gather", *whole], 1),
        "report": (["-m", "stages.report", *whole, f"--out={out}/report.html"], 1),
        "draw_figures": (["-m", "stages.draw_figures", *whole, f"--out={out}/figures"], 1),
    }


def _starts(study: Study) -> dict[str, float]:
    """Processor seconds to start Python and import what these use, on a copy; a fork's start is who asks."""
    _tell_what_is_right(study)
    with tempfile.TemporaryDirectory() as name:
        copy = Study(Path(name, "copy"), 1, study.models)
        shutil.copytree(study.folder, copy.folder)
        starts = {stage: _imports_s(words, copy.folder) for stage, (words, _) in _at_the_end(copy).items()}
    return starts | {FORK: min(measure(["-c", "import stages.job"]).processor_s for _ in range(9))}


def _tell_what_is_right(study: Study) -> None:
    """Read the study's configuration, as the workflow does, so that what starts next need not check it."""
    found = read_study(study.file)
    read_layout(found.recordings[0].layout)
    for model in found.models.values():
        read_model(model)
    tell_children()


def _imports_s(words: Sequence[str], folder: Path) -> float:
    """Processor seconds of Python's start and of importing what a process imports, wherever it does so."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-c", _NAMED, *words[1:]]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder, env=environment)
    names = done.stdout.splitlines()[-1]
    return min(measure(["-c", _IMPORTED, names]).processor_s for _ in range(3))


def _row(what: str, study: Study, cost: Cost, stages: Sequence[Stage] = ()) -> tuple[Cell, ...]:
    recordings = len(HANDS) * len(TASKS) * study.subjects
    share = 100 * sum(stage.work_s for stage in stages) / cost.processor_s if stages else None
    each_s = cost.seconds / recordings if stages else None
    return what, cost.seconds, each_s, cost.processor_s, share, cost.largest_mb


def _whole(rows: list[tuple[Cell, ...]]) -> TextTable:
    return TextTable(
        f"studies: {len(PAPER_STYLE)} models, 2 hands x {len(TASKS)} recordings a subject, {CORES} cores",
        (
            ("study", ""),
            ("s", ".1f"),
            ("s a recording", ".2f"),
            ("processor s", ".0f"),
            ("% of it in the stages' work", ".0f"),
            ("largest process, MB", ".0f"),
        ),
        rows,
        "The whole workflow, report and figures included; Snakemake's own start and planning too. Work is "
        "what the stages' processes take beyond starting Python and importing. Recordings are 16 receivers, "
        f"{' and '.join(map(str, FRAMES.values()))} frames, of {len(SIMULATED)} simulated subjects under as "
        "many names as are asked for.",
    )


def _by_stage(study: Study, stages: Sequence[Stage]) -> TextTable:
    rows: list[tuple[Cell, ...]] = [
        (s.name, s.jobs, s.start_s, s.work_s / s.jobs, s.work_s, 100 * s.work_s / s.processor_s)
        for s in stages
    ]
    return TextTable(
        f"studies: the stages of {study.subjects} subjects, {len(PAPER_STYLE)} models",
        (
            ("stage", ""),
            ("jobs", "d"),
            ("start s a job", ".2f"),
            ("work s a job", ".2f"),
            ("work s of all", ".0f"),
            ("% work", ".0f"),
        ),
        rows,
        "Processor seconds. A job is a subject's hands under all models. Start: Python and the packages, or, "
        "of jobs that are forks of the warm process, of who asks for the fork. Work: arithmetic, reading and "
        "writing. Of subject_pages one job was measured.",
    )


def _fitted_row(study: Study, recordings: Path) -> tuple[Cell, ...]:
    """Run a study with all models; what it took, and what its fits took of that."""
    study.write(recordings)
    cost = study.run()
    fits, fits_s = _spent(study, "fit_hand")
    rest_s = sum(_spent(study, name)[1] for name in OF_A_SUBJECT if name != "fit_hand")
    share = 100 * fits_s / cost.processor_s
    return study.subjects, cost.seconds, cost.processor_s, fits, fits_s, share, fits_s / fits, rest_s


def _seven(rows: list[tuple[Cell, ...]]) -> TextTable:
    return TextTable(
        f"studies: all {len(ALL_MODELS)} models",
        (
            ("subjects", "d"),
            ("s", ".0f"),
            ("processor s", ".0f"),
            ("fits", "d"),
            ("fits' s", ".0f"),
            ("% of all", ".0f"),
            ("s a fit", ".1f"),
            ("the other stages' s", ".0f"),
        ),
        rows,
        "Processor seconds but for the second column. A fit is a hand under whole-hand, posed in its "
        "recordings too; the other models have none.",
    )


def _spent(study: Study, stage: str) -> tuple[int, float]:
    """Units of a stage that were made, and the processor seconds of its jobs."""
    logs = (study.results / "logs" / stage).rglob("*.log")
    found = [match for log in logs if (match := _SPENT.search(log.read_text("utf-8")))]
    return sum(int(match[1]) for match in found), sum(float(match[3]) for match in found)
