"""A study with nearly every kind of fault: the good subject is unaffected and every fault is reported.

The good subject's results are the same bytes in any folder and with any number of cores.
"""

import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from studies.running import Row, StudyRun, hashes, leftovers, record, write_study

from shukotsu import command_line
from shukotsu.study.findings import STAGE
from shukotsu.study.results import STUDY_TABLES
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.subjects import path_token
from shukotsu.tables.typed_table import read_table

pytestmark = pytest.mark.slow

HOSTILE = 'A & <b>"x"'
JAPANESE = "山田 花子"
SLASHED = "/" * 24
PATTERN = "{subject}"
LONG, LONG_FILE = "s" * 300, f"{'f' * 300}.csv"
DEAD = "index_middle"
REASON = "the <b>receiver</b> slipped & fell"
MODEL = "paper-fig4-corrected"
NUMBERS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")

GOOD = [
    "good\tright\trom\tcalibration\tgood-right-rom.parquet",
    "good\tright\topposition\tevaluation\tgood-right-opposition.csv",
    "good\tleft\trom\tboth\tgood-left-rom.parquet",
]
BAD = [
    "missing\tright\trom\tboth\tnowhere.parquet",
    "missing\tleft\trom\tboth\tdata\\rom.csv",
    "truncated\tright\trom\tboth\ttruncated.parquet",
    "truncated\tleft\trom\tboth\ttruncated.csv",
    f"{PATTERN}\tright\t{{rom}}\tboth\t{{x}}.parquet",
    f"{PATTERN}\tleft\trom\tboth\ta {{b}} c.csv",
    f"{HOSTILE}\tright\trom\tboth\t<b>.parquet",
    f"{HOSTILE}\tleft\trom\tboth\tgone & <b>.csv",
    f"{JAPANESE}\tright\trom\tboth\tgood-right-rom.parquet",
    f"{SLASHED}\tleft\trom\tboth\tgood-left-rom.parquet",
    f"{SLASHED}\tleft\topposition\tevaluation\texcluded.parquet\t{REASON}",
    "one-sided\tright\trom\tcalibration\tgood-right-rom.parquet",
    "one-sided\tleft\trom\tevaluation\tgood-left-rom.parquet",
]
LEAVE_RESULTS = shutil.ignore_patterns("results", ".snakemake")
LEFT_OUT = [f"{LONG}\tright\trom\tboth\tgood-right-rom.parquet", f"gone\tright\trom\tboth\t{LONG_FILE}"]
"""Rows with names that are too long for a file."""
CORRECTIONS = [
    "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm",
    "good\tright\tring_dip\t1\t2\t3",
    "good\tright\tindex_pop\t1\t2\t3",
    "nobody\tleft\tindex_pip\t1\t2\t3",
]

FAILED = {
    ("missing", "right"): "nowhere.parquet: no such file",
    ("missing", "left"): "folders are separated by / and not by \\",
    ("truncated", "right"): "truncated.parquet: not a readable Parquet file",
    ("truncated", "left"): "truncated.csv: line 119: has",
    (HOSTILE, "left"): "gone & <b>.csv: no such file",
}
"""Hands whose recording cannot be read, and the message about it in every table that lacks it."""
RECORDINGS = {("rom", *who): ("failed", text) for who, text in FAILED.items()} | {
    ("{rom}", PATTERN, "right"): ("used", f"no usable pose of {DEAD}"),
    ("rom", PATTERN, "left"): ("used", f"no usable pose of {DEAD}"),
    ("opposition", SLASHED, "left"): ("excluded", REASON),
}
PROBLEMS = [
    *((f"{', '.join(who)}, rom", text) for who, text in FAILED.items()),
    ("one-sided, left", "no recording calibrates this hand"),
    (f"{LONG}, right, rom", "troubled.tsv: row 18, columns subject, session, task, trial: have 3"),
    ("gone, right, rom", "troubled.tsv: row 19, column file: has a part of more than 255 bytes"),
    ("", "corrections.tsv: row 3, column joint: 'index_pop' is not a joint of layout liberty16"),
    ("", "corrections.tsv: row 4, column subject: the study has no left hand of 'nobody'"),
]
FINDINGS = {
    (f"{HOSTILE}, right, rom", "same-file"),
    (f"{JAPANESE}, right, rom", "same-file"),
    (f"{SLASHED}, left, rom", "same-file"),
    ("one-sided, right, rom", "same-file"),
    ("one-sided, left, rom", "same-file"),
    (f"{PATTERN}, left, rom", "wrong-hand"),
    (f"{PATTERN}, right, {{rom}}", "receivers-absent"),
    (f"{PATTERN}, left, rom", "receivers-absent"),
}
"""Expected findings: files used for several people, a right hand used as a left one, a dead receiver."""
WITHOUT_JOINTS = FAILED | {("one-sided", "left"): "no calibration recording"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the intact and damaged recordings and the corrections."""
    folder = tmp_path_factory.mktemp("wrong")
    right = record(folder / "good-right-rom.parquet")
    csv = record(folder / "good-right-opposition.csv", task="opposition")
    record(folder / "good-left-rom.parquet", hand="left")
    (folder / "truncated.parquet").write_bytes(right.read_bytes()[:20_000])
    (folder / "truncated.csv").write_bytes(csv.read_bytes()[:20_000] + b"\n")
    (folder / "<b>.parquet").write_bytes(right.read_bytes())
    empty_receiver(right, folder / "{x}.parquet")
    lines = [line for line in csv.read_text().splitlines() if DEAD not in line]
    (folder / "a {b} c.csv").write_text("\n".join(lines) + "\n")
    (folder / "corrections.tsv").write_text("\n".join(CORRECTIONS) + "\n")
    return folder


@pytest.fixture(scope="module")
def ran(folder: Path) -> tuple[StudyRun, str]:
    """The faulty study and what Snakemake printed during its run, which ended with exit code 0."""
    study = write_study(folder, "troubled", GOOD + BAD + LEFT_OUT, [MODEL], corrections="corrections.tsv")
    return study, study.run("--verbose")


@pytest.fixture(scope="module")
def study(ran: tuple[StudyRun, str]) -> StudyRun:
    return ran[0]


@pytest.fixture(scope="module")
def good_alone(folder: Path) -> StudyRun:
    study = write_study(folder, "untroubled", GOOD, [MODEL], corrections="corrections.tsv")
    study.run(cores=1)
    return study


def empty_receiver(sound: Path, dead: Path) -> None:
    table = pq.read_table(sound)
    empty = pc.equal(table.column("segment"), DEAD)
    for name in NUMBERS:
        column = pc.if_else(empty, pa.scalar(None, pa.float64()), table.column(name))
        table = table.set_column(table.column_names.index(name), name, column)
    pq.write_table(table, dead)


def test_rows_that_cannot_be_used_are_noted(ran: tuple[StudyRun, str]) -> None:
    assert ran[1].count("the row was left out") == len(LEFT_OUT)


def test_snakemake_schedules_only_when_a_job_has_ended(ran: tuple[StudyRun, str]) -> None:
    """Snakemake's own timers would schedule more often the more jobs have ended."""
    scheduled, ended = (ran[1].count(words) for words in ("Ready jobs: ", "Finished jobid: "))
    assert 1 < scheduled <= ended + 1


@pytest.mark.parametrize("table", STUDY_TABLES)
def test_every_table_exists_and_matches_its_schema(study: StudyRun, table: str) -> None:
    """Only tables of the whole-hand fit, of the truth and of events are empty: the study has none of
    these.
    """
    without_fit = {"receivers", "moved_receivers", "gains", "joint_errors", "agreement"}
    without_events = {"events", "clocks", "movement_cycles", "cycle_curves", "event_strokes"}
    assert bool(study.rows(table)) == (table not in without_fit | without_events)


@pytest.mark.parametrize("table", ["joint_centres", "bone_lengths", "tip_errors"])
def test_the_good_subjects_results_are_unaffected(study: StudyRun, good_alone: StudyRun, table: str) -> None:
    """Its rows are bit for bit those of a study without the other subjects."""

    def of_the_good_subject(run: StudyRun) -> pa.Table:
        whole = read_table(run.results.study_table(table), TABLES[table])
        return whole.filter(pc.equal(whole.column("subject"), "good")).replace_schema_metadata(None)

    assert of_the_good_subject(study).num_rows
    assert of_the_good_subject(study).equals(of_the_good_subject(good_alone))


def test_results_do_not_depend_on_folder_cores_and_threads(
    good_alone: StudyRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A copy in a deeper folder of another name, run on two cores with two threads per library, gives the
    same bytes. No result except logs contains the folder's path.
    """
    shutil.copytree(good_alone.folder, tmp_path / "the study" / "of two", ignore=LEAVE_RESULTS)
    copy = StudyRun(
        tmp_path / "the study" / "of two" / good_alone.file.name, tmp_path / "the study" / "of two"
    )
    for name in command_line.ONE_THREAD:
        monkeypatch.setenv(name, "2")
    copy.run(cores=2)
    results = good_alone.results.folder
    digests = hashes(results)
    assert {"report.html", "sub-good/tips.parquet", "problems.parquet"} <= set(digests)
    assert digests == hashes(copy.results.folder)
    folder = str(good_alone.folder).encode()
    assert not [name for name in digests if folder in (results / name).read_bytes()]


def test_every_recording_has_its_status_and_message(study: StudyRun) -> None:
    rows = study.rows("recordings")
    cells = [line.split("\t") for line in GOOD + BAD]
    assert sorted((row["subject"], row["file"]) for row in rows) == sorted((c[0], c[4]) for c in cells)
    for row in rows:
        which = (row["task"], row["subject"], row["hand"])
        status, words = RECORDINGS.get(which, ("used", ""))
        assert row["status"] == status, which
        assert words in row["message"], which
        assert bool(words) == bool(row["message"]), which


def _where(row: Row) -> str:
    return ", ".join(filter(None, (row["subject"], row["hand"], row["task"], row["model"])))


def test_every_problem_is_listed_once(study: StudyRun) -> None:
    rows = study.rows("problems")
    problems = [(_where(row), row["message"]) for row in rows if row["stage"] != STAGE]
    for where, text in PROBLEMS:
        assert [at for at, message in problems if text in message].count(where) == 1, where
    assert len(problems) == len(PROBLEMS)
    assert {(_where(row), row["kind"]) for row in rows if row["stage"] == STAGE} == FINDINGS


@pytest.mark.parametrize("who", WITHOUT_JOINTS, ids=", ".join)
def test_a_hand_without_calibration_has_failed_joints_and_no_tip_errors(
    study: StudyRun, who: tuple[str, str]
) -> None:
    (subject, hand), reason = who, WITHOUT_JOINTS[who]
    joints = study.rows_where("joint_centres", subject=subject, hand=hand)
    fitted = [row for row in joints if row["joint"] != "wrist"]
    assert len(fitted) == 15
    assert {row["status"] for row in fitted} == {"failed"}
    assert all(reason in row["message"] for row in fitted)
    assert all(row["child_x_mm"] is None for row in fitted)
    errors = study.rows_where("tip_errors", subject=subject, hand=hand)
    assert len(errors) == 10
    assert all(row["n_frames"] == 0 and row["mean_mm"] is None for row in errors)
    assert all(reason in row["message"] for row in errors)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_a_dead_receiver_costs_only_its_two_joints_and_its_digit(study: StudyRun, hand: str) -> None:
    errors = study.rows_where("tip_errors", subject=PATTERN, hand=hand)
    touched = [row for row in errors if row["digit"] == "index"]
    others = [row for row in errors if row["digit"] != "index"]
    assert [row["n_frames"] for row in touched] == [0, 0]
    assert all(DEAD in row["message"] for row in touched)
    assert [row["n_frames"] for row in others] == [300] * 8
    assert all(0 < row["mean_mm"] < 10 for row in others)
    joints = study.rows_where("joint_centres", subject=PATTERN, hand=hand)
    failed = [row for row in joints if row["status"] == "failed"]
    assert [row["joint"] for row in failed] == ["index_pip", "index_dip"]
    assert all(DEAD in row["message"] for row in failed)


def test_every_job_has_a_log_with_the_reason_of_a_failure(study: StudyRun) -> None:
    names = map(path_token, (HOSTILE, SLASHED, PATTERN, "missing", JAPANESE, "one-sided"))
    stages = ("plan", "solve_joints", "project_planes", "estimate_metacarpals", "evaluate_tips")
    wanted = {f"{stage}/sub-{name}.log" for name in names for stage in stages}
    logs = study.results.folder / "logs"
    assert [name for name in {*wanted, "gather.log", "report.log"} if not (logs / name).is_file()] == []
    log = logs / "capture" / "sub-missing_hand-right_rom.log"
    assert log.read_text() == "error: nowhere.parquet: no such file; expected a recording\n"
    assert not leftovers(study.folder)


def test_a_change_of_a_file_named_like_a_pattern_is_noticed(study: StudyRun) -> None:
    """It must run last, as it changes the study."""
    (study.folder / "{x}.parquet").write_bytes((study.folder / "<b>.parquet").read_bytes())
    assert {job.subject for job in study.planned() if job.rule == "capture"} == {path_token(PATTERN)}
