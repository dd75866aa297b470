"""`shukotsu completion`: real shells complete commands, stages and options."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from shukotsu.completion import main as completion
from shukotsu.completion import options

BASH = 'source {}; COMP_WORDS=({}); COMP_CWORD={}; _shukotsu; echo "${{COMPREPLY[@]}}"'


@pytest.fixture
def script(tmp_path: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest) -> Path:
    """The lines for the shell that the test is named with."""
    shell = request.node.name.split("_")[1]
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} on this machine")
    assert completion([shell]) == 0
    path = tmp_path / f"completion.{shell}"
    path.write_text(capsys.readouterr().out)
    return path


def output(*command: str) -> list[str]:
    """What a shell prints, by words."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()


def bash(script: Path, words: str) -> list[str]:
    """What bash offers for the last of the words."""
    return output("bash", "-c", BASH.format(script, words, len(words.split()) - 1))


def test_bash_completes(script: Path) -> None:
    assert bash(script, "shukotsu re") == ["report", "record"]
    assert bash(script, "shukotsu stage solve_j") == ["solve_joints", "solve_joints.check_calibration"]
    assert bash(script, "shukotsu run --d") == ["--dry-run"]
    assert bash(script, "shukotsu stage fit_hand --rep") == ["--replay"]
    assert bash(script, "shukotsu run stu") == []  # files are the shell's own


def test_fish_completes(script: Path) -> None:
    first = "source {}; complete -C 'shukotsu re' | string match -r '^[a-z]+'"
    assert output("fish", "-c", first.format(script)) == ["record", "report"]
    assert "--dry-run" in output("fish", "-c", f"source {script}; complete -C 'shukotsu run --d'")
    assert "solve_joints" in output("fish", "-c", f"source {script}; complete -C 'shukotsu stage sol'")


def test_zsh_reads_it(script: Path) -> None:
    assert output("zsh", "-f", "-c", f"source {script}; whence -w _shukotsu") == ["_shukotsu:", "function"]


def test_options_are_those_of_the_parsers() -> None:
    of = options()
    assert of["run"] == ["--cores", "--dry-run", "--help"]
    assert "--duration" in of["record"]
    assert "--model" in of["stage solve_joints"]
    assert all(own for own in of.values())
