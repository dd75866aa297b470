"""The command lines `record`, `devices` and `check`: help, refusals, exit codes."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from tracker_processes import REPOSITORY

from stages.capture import record_tracker


@pytest.mark.parametrize("word", ["record", "devices", "check"])
def test_help_has_an_example_and_imports_nothing_heavy(word: str) -> None:
    code = (
        "import sys, runpy\n"
        f"sys.argv = ['capture', '{word}', '--help']\n"
        "try:\n    runpy.run_module('stages.capture', run_name='__main__')\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'pyarrow', 'serial', 'scipy'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    example = shlex.split(done.stdout.split("example:")[1])
    assert example[:4] == ["python", "-m", "stages.capture", word]
    known = done.stdout.split("example:")[0]
    assert all(option in known for option in example if option.startswith("--"))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--duration", "0"], "--duration: is 0; expected seconds above 0"),
        (["--countdown", "-1"], "--countdown: is -1; expected 0 or more seconds"),
        (["--out", "rom.parquet"], "--out: is rom.parquet; expected a name that ends with .arrows"),
        (["--tracker", "fastrak", "--rate", "120"], "--rate: a fastrak has a rate of its own; leave it out"),
        (["--stations", "0"], "--stations: is '0'"),
        (["--items", "nothing"], "--items: is 'nothing'"),
        (["--hemisphere", "up"], "--hemisphere: is 'up'"),
        ([], "/dev/no-such-port: no such port"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_done(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rom.arrows"
    assert record_tracker.main(["--port", "/dev/no-such-port", "--out", str(out), *options]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: {sentence}")
    assert told.count("\n") == 1
    assert not out.exists()
