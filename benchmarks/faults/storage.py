"""Disks that are full, quotas, folders that are read-only and inputs that may not be read."""

from __future__ import annotations

import ctypes
import os
import random
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.faults.forked_job import prepare, run_forked
from benchmarks.faults.outcome import REFUSED, Limit, Row, Tries, not_tried
from benchmarks.faults.small_study import Command, SmallStudy, commands_of, state_of

ROOM_BYTES = (0, 4096, 65536)
"""Left on the disk, in whole pages of a file system in memory."""
QUOTA_BYTES = (500, 5000, 50000)
"""Most that a file may have."""
READ_ONLY = 0o555

Prepare = Callable[[], None] | None


def rows(limit: Limit, seed: int, study: SmallStudy) -> list[Row]:
    """Try every command under each of these faults."""
    prepare()
    commands = commands_of(study)
    study, chance = SmallStudy(study.folder, state_of(study.folder)), random.Random(seed)
    chance.shuffle(commands)
    owner = as_owner(study, commands, chance, limit)
    return [*owner, _quota(study, commands, limit), _full_disk(study, commands, limit)]


def _quota(study: SmallStudy, commands: Sequence[Command], until: Limit) -> Row:
    tries = Tries("a quota on the size of files", REFUSED)
    for command in commands:
        for most in QUOTA_BYTES:

            def limit(most: int = most) -> None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

            if not until.is_over:
                tries.add(try_once(study, command, limit))
    return tries.row()


def try_once(
    study: SmallStudy, command: Command, prepare: Prepare, restore: Callable[[], None] = lambda: None
) -> str:
    """Run a command under a fault and, when that is over, once more; give what was not as promised.

    restore : ends the fault.
    """
    try:
        ended = run_forked(command.argv, study.folder, prepare=prepare)
    finally:
        restore()
    problem = ended.refusal or study.damage(command.outputs)
    again = run_forked(command.argv, study.folder)
    problem = problem or (
        f"then exit {again.code}: {again.said[-300:]}" if again.code else study.incomplete()
    )
    return f"{command.name}: {problem}" if problem else ""


def _full_disk(study: SmallStudy, commands: Sequence[Command], limit: Limit) -> Row:
    tries = Tries("a full disk", REFUSED)
    with small_disk(study.folder.with_name("disk")) as disk:
        if disk is None:
            return not_tried(tries.fault, "a file system of some megabytes cannot be mounted here")
        study = study.copied(disk / "study")
        for command in commands:
            for room in () if limit.is_over else ROOM_BYTES:
                tries.add(fill_and_try(study, command, disk, room))
    return tries.row()


def fill_and_try(study: SmallStudy, command: Command, disk: Path, room: int) -> str:
    """Run a command, its outputs removed, with so many bytes left on the disk, see `try_once`."""
    for path in (study.folder / name for name in command.outputs):
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    ballast = disk / "ballast"
    _fill(ballast, room)
    return try_once(study, command, None, ballast.unlink)


def _fill(ballast: Path, room: int) -> None:
    """Leave so many bytes on the disk."""
    free = os.statvfs(ballast.parent)
    with ballast.open("wb") as stream:
        os.posix_fallocate(stream.fileno(), 0, free.f_bavail * free.f_frsize - room)


@contextmanager
def small_disk(folder: Path) -> Iterator[Path | None]:
    """A file system of 64 MB in memory; None where this user may not mount one."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True, check=False).returncode:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def as_owner(
    study: SmallStudy, commands: Sequence[Command], chance: random.Random, limit: Limit
) -> list[Row]:
    """What root may always do is tried without its privileges."""
    read_only = Tries("folders that are read-only", REFUSED)
    unreadable = Tries("an input that may not be read", "one sentence; then the same command, same bytes")
    for command in commands:
        if limit.is_over:
            break
        modes = {path: path.stat().st_mode for path in study.folder.rglob("*") if path.is_dir()}

        def restore(modes: dict[Path, int] = modes) -> None:
            for path, mode in modes.items():
                path.chmod(mode)

        for path in modes:
            path.chmod(READ_ONLY)
        read_only.add(try_once(study, command, _without_privileges, restore))
        inputs = [study.folder / name for name in command.inputs if (study.folder / name).is_file()]
        if inputs:
            unreadable.add(_without_leave(study, command, chance.choice(inputs)))
    return [read_only.row(), unreadable.row()]


def _without_leave(study: SmallStudy, command: Command, path: Path) -> str:
    """Run a command that may not read one of its inputs."""
    mode = path.stat().st_mode
    path.chmod(0)
    ended = run_forked(command.argv, study.folder, prepare=_without_privileges)
    path.chmod(mode)
    problem = ended.refusal
    if not problem and ended.code == 0 and path.name not in ended.said and study.incomplete():
        problem = f"other results without a word on {path.name}"
    again = run_forked(command.argv, study.folder)
    problem = problem or (
        f"then exit {again.code}: {again.said[-300:]}" if again.code else study.incomplete()
    )
    return f"{command.name}: {path.name}: {problem}" if problem else ""


def _without_privileges() -> None:
    """Leave this process, where it is root's, what its owner may do with a file and no more.

    Another user's it cannot be, who need not be able to read this Python.
    """
    version = 0x20080522  # of capset(2): two words each of what is effective, permitted, inheritable
    header, none = (ctypes.c_uint32 * 2)(version, 0), (ctypes.c_uint32 * 6)()
    if os.geteuid() == 0 and ctypes.CDLL(None, use_errno=True).capset(header, none) != 0:
        raise OSError(ctypes.get_errno(), "capset")
