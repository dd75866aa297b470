"""The fault matrix in small: it sees what it is to see, and the program keeps what is promised."""

from __future__ import annotations

import os
import random
import resource
from pathlib import Path

import pytest

from benchmarks.faults import changes, memory, recorder_kills, small_study, stage_kills, storage, study_kills
from benchmarks.faults.forked_job import Ended, prepare, run_forked
from benchmarks.faults.outcome import Limit, Tries, not_tried
from benchmarks.faults.small_study import Command, SmallStudy
from benchmarks.faults.write_order import violations

TEMPORARY, TABLE = "/s/results/.a.parquet.7.tmp", "/s/results/a.parquet"
WRITTEN = f'7 openat(AT_FDCWD</s>, "{TEMPORARY}", O_WRONLY|O_CREAT) = 3<{TEMPORARY}>\n'
WRITTEN += f'7 write(3<{TEMPORARY}>, "x", 1) = 1\n'
SYNCED = f"7 fsync(3<{TEMPORARY}>) = 0\n"
RENAMED = f'7 rename("{TEMPORARY}", "{TABLE}") = 0\n'
FOLDER_SYNCED = "7 fsync(4</s/results>) = 0\n"


@pytest.mark.parametrize(
    ("trace", "problem"),
    [
        (WRITTEN + SYNCED + RENAMED + FOLDER_SYNCED, []),
        (WRITTEN + RENAMED + FOLDER_SYNCED, ["a.parquet is renamed before its bytes are on the disk"]),
        (
            WRITTEN + SYNCED + WRITTEN + RENAMED + FOLDER_SYNCED,
            ["a.parquet is renamed before its bytes are on the disk"],
        ),
        (WRITTEN + SYNCED + RENAMED, ["the name a.parquet is never on the disk"]),
        (f'7 open("{TABLE}", O_WRONLY|O_TRUNC) = 3<{TABLE}>\n', ["a.parquet is written under its own name"]),
        (f'7 open("{TABLE}", O_RDONLY) = 3<{TABLE}>\n7 open("/t/a", O_WRONLY) = 3</t/a>\n', []),
        (f'7 open("{TABLE}", O_WRONLY) = -1 EACCES\n', []),
    ],
)
def test_the_order_of_writes_is_read_from_a_trace(trace: str, problem: list[str]) -> None:
    assert violations(trace, Path("/s")) == problem


@pytest.mark.parametrize(
    ("ended", "is_refusal"),
    [
        (Ended(0, "note: all well", 0.0), True),
        (Ended(2, "error: t.csv: is empty", 0.0), True),
        (Ended(2, "", 0.0), False),
        (Ended(2, "error: one\nerror: two", 0.0), False),
        (Ended(1, "Traceback (most recent call last):", 0.0), False),
        (Ended(0, "Traceback (most recent call last):", 0.0), False),
        (Ended(-11, "", 0.0), False),
    ],
)
def test_what_counts_as_a_refusal(ended: Ended, is_refusal: bool) -> None:
    assert (ended.refusal == "") == is_refusal


def test_what_could_not_be_tried_is_no_pass() -> None:
    tries = Tries("a fault")
    tries.add("")
    tries.add("half written")
    assert tries.row()[:3] == ("a fault", 2, 1)
    assert not_tried("a fault", "no disk")[1:] == (0, None, "not tried: no disk")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> SmallStudy:
    """A study that was run undisturbed."""
    return small_study.make_study(tmp_path_factory.mktemp("faults") / "study", ["rigid"], "bvh")


@pytest.fixture(scope="module")
def commands(study: SmallStudy, tmp_path_factory: pytest.TempPathFactory) -> tuple[SmallStudy, list[Command]]:
    """The commands of its jobs, and a copy of the study with what they have made."""
    prepare()
    own = study.copied(tmp_path_factory.mktemp("commands") / "study")
    found = small_study.commands_of(own)
    return SmallStudy(own.folder, own.state()), found


@pytest.mark.slow
def test_no_kill_of_a_stage_loses_anything(commands: tuple[SmallStudy, list[Command]]) -> None:
    study, each = commands
    for seed, command in enumerate(each):
        seconds = run_forked(command.argv, study.folder).seconds
        for afresh in (True, False):
            problem = stage_kills.kill_once(study, command, seconds, random.Random(seed), afresh=afresh)
            assert problem == "", command.name


@pytest.mark.slow
@pytest.mark.parametrize("most", [500, 5000])
def test_a_quota_is_one_sentence_and_no_result(commands: tuple[SmallStudy, list[Command]], most: int) -> None:
    """Of an export neither, whose other failures are files."""
    study, each = commands

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    assert [problem for command in each if (problem := storage.try_once(study, command, limit))] == []


@pytest.mark.slow
@pytest.mark.parametrize("size_mb", [120, 439])
def test_too_little_memory_is_one_sentence(commands: tuple[SmallStudy, list[Command]], size_mb: int) -> None:
    study, each = commands
    for command in each[::4]:
        assert memory.run_limited(study, command, size_mb).refusal == ""
    assert study.damage() == ""


@pytest.mark.slow
def test_no_kill_of_a_recording_loses_what_was_written(tmp_path: Path) -> None:
    study = SmallStudy(tmp_path, {})
    (row,) = recorder_kills.rows(Limit(3), 1, study)
    assert row[1:3] == (3, 0)


@pytest.mark.slow
def test_a_study_goes_on_after_kills(study: SmallStudy, tmp_path: Path) -> None:
    rows = study_kills.rows(Limit(3), 1, study.copied(tmp_path / "study"))
    assert all(row.tried and row.failed == 0 for row in rows)


@pytest.mark.slow
def test_what_changes_while_a_study_runs_is_noticed(study: SmallStudy, tmp_path: Path) -> None:
    rows = changes.rows(Limit(10), 1, study.copied(tmp_path / "study"))
    assert [row for row in rows if row.failed] == []


@pytest.mark.slow
def test_what_may_not_be_read_or_written_is_one_sentence(
    commands: tuple[SmallStudy, list[Command]],
) -> None:
    study, each = commands
    rows = storage.as_owner(study, each, random.Random(1), Limit(1))
    assert [row.tried > 0 and row.failed for row in rows] == [0, 0]


@pytest.mark.slow
@pytest.mark.skipif(os.geteuid() != 0, reason="a disk is mounted")
def test_a_full_disk_is_no_result(commands: tuple[SmallStudy, list[Command]], tmp_path: Path) -> None:
    study, each = commands
    with storage.small_disk(tmp_path / "disk") as disk:
        if disk is None:
            pytest.skip("no file system can be mounted here")
        there = study.copied(disk / "study")
        export = next(command for command in each if command.name == "export")
        assert storage.fill_and_try(there, export, disk, 4096) == ""
