"""The commands of `shukotsu`: their help, with a valid example and without slow imports."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest
from program_files import printed_by, run_python

from shukotsu.commands import COMMANDS

HEAVY = ("numpy", "scipy", "pandas", "pyarrow", "jsonschema", "jinja2", "matplotlib", "snakemake")
LIGHT_HELP = f"""
import sys
from shukotsu.__main__ import main
try:
    main(sys.argv[1:])
except SystemExit as ended:
    heavy = {HEAVY} and set({HEAVY}) & set(sys.modules)
    sys.exit(f"imported {{heavy}}" if heavy else ended.code)
"""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_commands_help_is_fast_and_has_a_valid_example(tmp_path: Path, command: str) -> None:
    """Run in another folder, the help has an example of the command with existing options, and imports no
    large package.
    """
    done = run_python(tmp_path, "-c", LIGHT_HELP, command, "--help")
    assert done.returncode == 0, done.stderr
    help_text, _, example = done.stdout.partition("example:")
    assert help_text.startswith(f"usage: shukotsu {command}")
    argv = shlex.split(example.replace("$(", "").replace(")", ""), comments=True)
    assert ["shukotsu", command] in [argv[i : i + 2] for i in range(len(argv))]
    arguments = argv[: argv.index("--")] if "--" in argv else argv
    assert [option for option in arguments if option.startswith("--") and option not in help_text] == []


def test_the_help_lists_every_command(tmp_path: Path) -> None:
    done = run_python(tmp_path, "-m", "shukotsu", "--help")
    assert done.returncode == 0
    for name, command in COMMANDS.items():
        assert f"  {name} " in done.stdout
        assert command.summary in done.stdout


def test_the_installed_command_runs_from_a_folder_with_misleading_names(tmp_path: Path) -> None:
    script = Path(sys.executable).with_name("shukotsu")
    for name in ("shukotsu", "schemas", "stages"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported from the folder')")
    printed_by(script, "new", "a", cwd=tmp_path)
    assert (tmp_path / "a" / "study.yaml").is_file()
