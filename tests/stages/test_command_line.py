"""Shared behaviour of the stages' command lines: hands without a plan, failures, and how processes end."""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from small_study import write_plans, write_study

from shukotsu import command_line
from shukotsu.errors import InputError, TableError
from shukotsu.study import subject_stage
from shukotsu.study.plan_file import read_plan
from shukotsu.study.verdict import UNJUDGED
from shukotsu.tables.catalogue import GAINS, JOINT_CENTRES, POSES
from shukotsu.tables.parquet_files import naming_damage
from shukotsu.tables.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table
from shukotsu.tables.whole_files import write_text

REPOSITORY = Path(__file__).resolve().parents[2]
RIGHT, LEFT = Part("right", "rigid", "", "01"), Part("left", "rigid", "", "01")
NO_ROWS = columns_from_rows(POSES, [])
ROW = {"joint": "wrist", "parent_segment": "", "child_segment": "hand", "dof": 0, "n_frames": 0}
ROW |= {"source": "", "status": "ok", "message": "", **UNJUDGED}


# --- which hands ------------------------------------------------------------------------------------------


def options(*argv: object) -> argparse.Namespace:
    parser = command_line.parser("stages.any", "Any.", "any")
    subject_stage.add_plan_options(
        parser,
        "joint_solutions",
        calibration="--calibration",
        evaluated="--poses",
        sizes=("hand_length_mm", "hand_breadth_mm"),
        sheets=("corrections",),
    )
    return parser.parse_args([str(argument) for argument in argv])


def poses(path: Path, task: str, hand: str = "right") -> Path:
    names = {"subject": "01", "hand": hand, "task": task, "trial": ""}
    write_table(path, POSES, NO_ROWS, Provenance(parameters=names))
    return path


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("--in", "a.csv", "--out", "a.csv"), "--out: a.csv: is also an input, which would be"),
        (("--in", "link.csv", "--out", "./a.csv"), "--out: a.csv: is also an input"),
        (("--in", "a.csv", "b.csv", "--out", "b.csv"), "--out: b.csv: is also an input"),
        (("--out", "c.csv", "--out-bones", "./x/../c.csv"), "--out-bones: x/../c.csv: is also the file of"),
        (("--in", ".", "--out", "."), ""),
        (("--in", "a.csv", "--out", "c.csv", "--out-bones", "d.csv"), ""),
    ],
)
def test_an_output_that_would_replace_an_input_is_refused(
    argv: Sequence[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "b.csv"):
        Path(name).touch()
    Path("x").mkdir()
    Path("link.csv").symlink_to("a.csv")
    parser = command_line.parser("stages.any", "Any.", "any")
    parser.add_argument("--in", dest="file", type=Path, nargs="*")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--out-bones", type=Path)
    worked: list[argparse.Namespace] = []
    status = command_line.script(lambda: parser, worked.append)(argv)
    assert (status, len(worked)) == ((2, 0) if message else (0, 1))
    assert message in capsys.readouterr().err


def test_a_hand_without_a_plan_gets_a_plan_of_its_poses(tmp_path: Path) -> None:
    rom, pinch = poses(tmp_path / "1", "rom"), poses(tmp_path / "2", "pinch")
    alone = ["--layout", "liberty16", "--model", "rigid", "--calibration", rom, "--poses", pinch]
    arguments = options(*alone, "--hand-length-mm", 181, "--hand", "right")
    plan = subject_stage.plan_of(arguments)
    assert (plan.who.subject, *plan.sizes_mm.values()) == ("01", 181.0, None)
    assert subject_stage.poses_files(plan) == [rom, pinch]
    assert plan.parts() == [RIGHT]
    assert [path.name for path in subject_stage.config_files(arguments)] == ["liberty16.yaml", "rigid.yaml"]


def test_poses_of_a_recording_not_in_the_plan_are_refused(tmp_path: Path) -> None:
    rows = ("01 right rom both a.csv", "01 right pinch both b.csv - - moved")
    plan = read_plan(write_plans(write_study(tmp_path, *rows))["01"])
    path = plan.poses(plan.recordings[0])
    write_text(path, "")
    poses(path, "rom")
    assert subject_stage.poses_files(plan) == [path]
    for task, hand in (("pinch", "right"), ("rom", "left")):
        poses(path, task, hand)
        with pytest.raises(TableError, match=f"of subject 01, {hand} hand, {task}; expected subject 01"):
            subject_stage.poses_files(plan)


def test_a_table_made_from_other_inputs_is_refused(tmp_path: Path) -> None:
    """Such tables come from a restored backup, or exist after poses were made again by hand."""
    plan = read_plan(write_plans(write_study(tmp_path, "01 right rom both a.csv"))["01"])
    recording = poses(plan.poses(plan.recordings[0]), "rom")
    table, other = plan.table("joint_solutions"), plan.table("joint_centres")
    for path in (table, other):
        with parts_writer(path, JOINT_CENTRES, Provenance.of([recording], plan.folder)):
            pass
    provenance = subject_stage.provenance_of(plan, [table, other], [recording])
    assert [name for name, _ in provenance.inputs][2:] == ["right/rom/poses.parquet"]
    subject_stage.check_made_together(table, other)
    with parts_writer(tmp_path / "foreign.parquet", JOINT_CENTRES, Provenance()) as writer:
        writer.rows(Part("right", "rigid", "", "02"), [])
    with pytest.raises(TableError, match=r"foreign\.parquet: has no rows of subject 01, but of 02; name"):
        subject_stage.provenance_of(plan, [table, tmp_path / "foreign.parquet"], [recording])
    poses(recording, "rom", "left")
    with parts_writer(other, JOINT_CENTRES, Provenance.of([recording], plan.folder)):
        pass
    with pytest.raises(TableError, match=r"joint_solutions\.parquet: was made from another version of"):
        subject_stage.provenance_of(plan, [other, table], [recording])
    with pytest.raises(TableError, match=r"joint_centres\.parquet: was not made from the same files as"):
        subject_stage.check_made_together(table, other)


def test_running_out_of_memory_ends_with_one_sentence(capsys: pytest.CaptureFixture[str]) -> None:

    def work(_: argparse.Namespace) -> None:
        raise pa.ArrowMemoryError("malloc of size 99 failed")

    main = command_line.script(any_parser, work, lambda *_: pytest.fail("recorded"))
    assert main(["--record-failure"]) == 2
    assert capsys.readouterr().err.startswith(
        "error: not enough memory (malloc of size 99 failed); run fewer"
    )
    with pytest.raises(MemoryError), naming_damage(Path("a.parquet")):
        work(argparse.Namespace())


# --- failing ----------------------------------------------------------------------------------------------

INTERNAL = "internal error in any (ZeroDivisionError: oh); please report it with the log"


def any_parser() -> argparse.ArgumentParser:
    return command_line.parser("shukotsu stage any", "Any.", "any")


@pytest.mark.parametrize(
    ("argv", "error", "code", "recorded"),
    [
        ((), InputError("f.csv: row 3"), 2, []),
        (("--record-failure",), InputError("f.csv: row 3"), 0, ["f.csv: row 3"]),
        (("--record-failure",), TableError("t: cut"), 2, []),
        (("--record-failure",), ZeroDivisionError("oh"), 0, [INTERNAL]),
    ],
    ids=["bad-input", "recorded", "damaged-table", "bug"],
)
def test_a_failure_is_logged_and_recorded_on_request(
    capsys: pytest.CaptureFixture[str],
    argv: tuple[str, ...],
    error: Exception,
    code: int,
    recorded: list[str],
) -> None:
    messages: list[str] = []

    def work(_: argparse.Namespace) -> None:
        raise error

    main = command_line.script(any_parser, work, lambda _, message: messages.append(message))
    assert main(argv) == code
    assert messages == recorded
    log = capsys.readouterr().err
    if isinstance(error, InputError):
        assert log == f"error: {error}\n"
    else:
        assert "Traceback" in log


@pytest.mark.parametrize(
    ("error", "message"),
    [(InputError("no usable poses"), "no usable poses"), (ZeroDivisionError("oh"), INTERNAL)],
)
def test_a_failed_part_is_recorded_in_every_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], error: Exception, message: str
) -> None:
    paths = [tmp_path / "one.parquet", tmp_path / "two.parquet"]
    arguments = argparse.Namespace(stage="any", record_failure=True)
    with (
        parts_writer(paths[0], JOINT_CENTRES, Provenance()) as first,
        parts_writer(paths[1], GAINS, Provenance()) as second,
    ):
        for part in (RIGHT, LEFT):
            with subject_stage.recording_failure(arguments, part, first, second):
                first.rows(part, [ROW])
                if part == RIGHT:
                    raise error
                second.rows(part, [])
    for path, table in zip(paths, (JOINT_CENTRES, GAINS), strict=True):
        assert part_metadata(path, table) == {RIGHT: {"failure": message}, LEFT: {}}
    assert read_part(paths[0], JOINT_CENTRES, LEFT).num_rows == 1
    log = capsys.readouterr().err
    assert ("Traceback" in log) == isinstance(error, ZeroDivisionError)
    assert str(error) in log


# --- how a process ends ------------------------------------------------------------------------------------


def run_as_command(work: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run code as a command in a separate process that ends as every command does."""
    code = (
        "import sys, os, signal, time; from pathlib import Path; from shukotsu import command_line\n"
        f"def work():\n    {work}\nsys.exit(command_line.run_command(work))"
    )
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, cwd=REPOSITORY, stderr=subprocess.PIPE, text=True, check=False, timeout=60, **options
    )


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_standard_output_ends_with_one_sentence(unbuffered: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = run_as_command(
            "print('a line')", stdout=full, env=os.environ | {"PYTHONUNBUFFERED": unbuffered}
        )
    assert done.returncode == 2
    assert done.stderr.startswith("error: standard output")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("number", "code"), [("SIGINT", 130), ("SIGTERM", 143), ("SIGHUP", 129)])
def test_an_interrupted_command_leaves_no_file_or_traceback(tmp_path: Path, number: str, code: int) -> None:
    write = "from shukotsu.tables.whole_files import replacing\n"
    write += f"    with replacing(Path({str(tmp_path / 'table')!r})) as half: "
    work = f"{write}half.touch(); os.kill(os.getpid(), signal.{number}); time.sleep(9)"
    # the signal is not ignored, even if the caller ignores it
    done = run_as_command(work, preexec_fn=partial(signal.signal, signal.Signals[number], signal.SIG_DFL))
    assert done.returncode == code
    assert done.stderr == ("error: interrupted\n" if code == 130 else f"error: ended by {number}\n")
    assert not list(tmp_path.iterdir())


def test_libraries_use_one_thread_in_any_environment() -> None:
    """With two threads the last digits of a sum of a million numbers would differ."""
    work = "import numpy as np; x = np.random.default_rng(1).normal(size=10**6); print((x @ x).hex())"
    threads = [dict.fromkeys(command_line.ONE_THREAD, number) for number in "12"]
    first, second = (
        run_as_command(work, stdout=subprocess.PIPE, env=os.environ | each).stdout for each in threads
    )
    assert first == second != ""


def test_a_closed_pipe_ends_the_command_silently() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = run_as_command("print('a line', flush=True)", stdout=writing)
    os.close(writing)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")
