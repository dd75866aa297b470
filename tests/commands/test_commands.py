"""The commands of `shukotsu` and the stages: their help, with a valid example and without slow imports."""

import shlex
import sys
from pathlib import Path

import pytest
from program_files import PACKAGE, printed_by, run_python

from shukotsu.commands import COMMANDS
from shukotsu.commands.run_stage import STAGES

NAMES = {"capture": "shukotsu import"}
"""Names of stages in their help if they are also commands."""
PROGRAMS: list[tuple[str, list[str]]] = [
    *((f"shukotsu {name}", [str(PACKAGE / "__main__.py"), name]) for name in COMMANDS),
    *((NAMES.get(path.stem, f"shukotsu stage {path.stem}"), [str(path)]) for path in STAGES.glob("*.py")),
]
"""The name of every command and stage in its help, and the script and words that run it."""
LIGHT_HELP = """
import runpy, sys
del sys.argv[0]
try:
    runpy.run_path(sys.argv[0], run_name="__main__")
except SystemExit as ended:
    heavy = {"numpy", "scipy", "pandas", "pyarrow", "jsonschema", "jinja2", "matplotlib", "snakemake"}
    heavy &= set(sys.modules)
    sys.exit(f"imported {heavy}" if heavy else ended.code)
"""


@pytest.mark.parametrize(("name", "words"), PROGRAMS)
def test_help_is_fast_and_has_a_valid_example(tmp_path: Path, name: str, words: list[str]) -> None:
    """Run in another folder, the help has an example of the command or stage with existing options, and
    imports no large package.
    """
    done = run_python(tmp_path, "-c", LIGHT_HELP, *words, "--help")
    assert done.returncode == 0, done.stderr
    help_text, _, example = done.stdout.partition("example:")
    assert help_text.startswith(f"usage: {name}")
    argv = shlex.split(example.replace("$(", "").replace(")", ""), comments=True)
    assert name.split() in [argv[i : i + len(name.split())] for i in range(len(argv))]
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
