"""The computer beside the tracker may run Windows: its commands run with all taken away that Unix alone has.

No such machine takes part: modules and functions are taken away here, so what Windows itself does otherwise
(its drivers, its consoles, its locks on open files) is not seen.
"""

import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from tracker_processes import PATIENCE_S, REPOSITORY, emulator

from shukotsu.trackers.record.keyboard import ConsoleKeyboard, Keyboard, keyboard_of

WITHOUT_UNIX = """
# What other packages have of Unix is theirs.
import asyncio, mmap, multiprocessing, os, signal, subprocess, sys, tempfile
import ezc3d, numpy, pandas, pyarrow.parquet, scipy.linalg, scipy.signal, serial, serial.tools.list_ports
for name in ("termios", "tty", "pty", "fcntl", "resource", "grp", "pwd", "syslog", "readline"):
    sys.modules[name] = None
missing = {
    os: "fork forkpty openpty ttyname getpgrp getpgid tcgetpgrp tcsetpgrp setsid killpg sysconf uname getuid "
        "geteuid getloadavg mkfifo statvfs set_blocking pread pwrite sched_getaffinity nice umask",
    signal: "SIGHUP SIGPIPE SIGKILL SIGTSTP SIGTTOU SIGTTIN SIGALRM SIGUSR1 SIGUSR2 SIGQUIT setitimer alarm",
    mmap: "MADV_DONTNEED PROT_READ MAP_SHARED",
}
for module, names in missing.items():
    for name in names.split():
        if hasattr(module, name):
            delattr(module, name)
from shukotsu.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


def shukotsu(*argv: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command without Unix; it must not end with a traceback."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_UNIX, *map(str, argv)],
        cwd=folder, env=os.environ | {"PYTHONPATH": str(REPOSITORY)}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=2 * PATIENCE_S, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_a_recording_from_the_port_to_the_table_of_poses(tmp_path: Path) -> None:
    with emulator("--stations", "1-4", port=("--tcp", "0")) as device:
        tracker = shukotsu("record", "--ask", "--port", device.name, folder=tmp_path)
        assert tracker.returncode == 0, tracker.stderr
        assert "receivers   1, 2, 3, 4" in tracker.stdout
        recording = ("--port", device.name, "--out", "a.arrows", "--duration", "1")
        recorded = shukotsu("record", *recording, folder=tmp_path)
        assert recorded.returncode == 0, recorded.stderr
    for argv in (
        ("inspect", "a.arrows"),
        ("import", "--in", "a.arrows", "--layout", "liberty16", "--out", "poses.parquet", "--subject", "S01",
         "--hand", "right", "--task", "rom"),
        ("record", "--devices"),
    ):  # fmt: skip
        done = shukotsu(*argv, folder=tmp_path)
        assert done.returncode == 0, (argv, done.stderr)
    assert (tmp_path / "poses.parquet").stat().st_size > 1000


def test_an_emulator_at_a_port_of_the_network(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WITHOUT_UNIX, "emulate", "--tcp", "0"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            done = shukotsu("record", "--ask", "--port", process.stdout.readline().strip(), folder=tmp_path)
            assert done.returncode == 0, done.stderr
        finally:
            process.terminate()


@pytest.mark.parametrize(
    ("argv", "sentence"),
    [
        (("emulate", "--pty"), "error: --pty: this system has no pseudo-terminals; give --tcp 4001"),
        (("run",), "error: a study runs on Linux or macOS (on Windows: in WSL); copy this folder there"),
        (("demo",), "error: a study runs on Linux or macOS"),
    ],
)
def test_what_needs_unix_says_so(argv: tuple[str, ...], sentence: str, tmp_path: Path) -> None:
    done = shukotsu(*argv, folder=tmp_path)
    assert (done.returncode, done.stderr.startswith(sentence)) == (2, True), done.stderr


def test_keys_of_a_console_of_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    console = ModuleType("msvcrt")
    waiting = ["q", "x"]
    monkeypatch.setattr(console, "kbhit", lambda: bool(waiting), raising=False)
    monkeypatch.setattr(console, "getwch", waiting.pop, raising=False)
    monkeypatch.setitem(sys.modules, "msvcrt", console)
    keyboard = ConsoleKeyboard()
    assert (keyboard.pressed(), keyboard.pressed()) == ("xq", "")
    with Path(os.devnull).open() as stream:
        assert type(keyboard_of(stream)) is Keyboard, "what is no console gives no keys"
