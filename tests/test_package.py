"""The installed package: the wheel and its dependencies, the recorder alone, and use as a workflow module."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from program_files import REPOSITORY, printed_by, program_files

import shukotsu
from shukotsu.resources import VERSION

RECORDER = ("numpy", "pyarrow", "pyserial")
OF_BLENDER = ("bpy", "mathutils")
SMALL_STUDY = """
study: small
recordings: data/demo/recordings.tsv
layout: liberty16
models: [rigid]
simulation: {folder: data/demo/recordings, seed: 1}
"""
MODULE = """
configfile: "config.yaml"


module shukotsu:
    snakefile:
        "SNAKEFILE"
    config:
        config["hands"]


use rule * from shukotsu as hands_*


rule own:
    input:
        "results/small/sub-01/plan.json",
    default_target: True
"""


def run(*command: str | Path, folder: Path) -> str:
    """Run a command without this process's Python environment and return its output."""
    environ = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return printed_by(*command, cwd=folder, env=environ)


def test_every_imported_package_is_a_declared_dependency() -> None:
    """Packages installed only as dependencies of others might be missing with the others' next versions."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
    lines = [*project["dependencies"], *project["optional-dependencies"]["xarray"]]
    declared = {re.split(r"[^\w-]", line)[0].lower() for line in lines}
    pattern = re.compile(r"^\s*(?:from|import) (\w+)", re.MULTILINE)
    texts = [path.read_text("utf-8") for path in program_files(suffix=".py")]
    imported = {name for text in texts for name in pattern.findall(text)}
    owners = packages_distributions()
    of_types = {"jaxtyping"}  # for type checkers and the tests' shape checks only
    foreign = (imported & owners.keys()) - sys.stdlib_module_names - {"shukotsu", *OF_BLENDER, *of_types}
    assert len(foreign) > 10
    assert {name: owners[name][0] for name in foreign if owners[name][0].lower() not in declared} == {}


def test_the_version_is_the_same_everywhere() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == VERSION == shukotsu.__version__


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, folder=REPOSITORY)
    (source,) = folder.glob("*.tar.gz")
    run("tar", "xzf", source, folder=folder)
    unpacked = folder / source.name.removesuffix(".tar.gz")
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, folder=unpacked)
    (built,) = folder.glob("*.whl")
    return built


def environment(folder: Path, wheel: Path, *only: str) -> Path:
    """Make an environment with the wheel and the packages of the users' lock, linked from the present
    environment.

    only : names of the packages to include, by default all. Returns the folder of its programs.
    """
    run(sys.executable, "-m", "venv", folder, folder=REPOSITORY)
    (packages,) = folder.glob("lib/*/site-packages")
    lock = (REPOSITORY / "requirements.lock").read_text("utf-8")
    pins = map(Requirement, re.findall(r"^(\w[^\\\n]+)", lock, re.MULTILINE))
    for pin in pins:
        if pin.name in (only or (pin.name,)) and (pin.marker is None or pin.marker.evaluate()):
            installed = distribution(pin.name)
            assert installed.version in pin.specifier
            for name in {file.parts[0] for file in installed.files or ()} - {"..", "__pycache__"}:
                (packages / name).symlink_to(str(installed.locate_file(name)))
    program = folder / "bin" / "python"
    options = ("--no-index", *(["--no-deps"] if only else []))
    run(program, "-m", "pip", "--quiet", "install", *options, wheel, folder=folder)
    kernel = Path("shukotsu", "fit", "kernel")  # include the cached machine code, which takes 30 s to compile
    shutil.copytree(REPOSITORY / kernel, packages / kernel, dirs_exist_ok=True)
    return program.parent


@pytest.mark.slow
def test_the_wheel_contains_exactly_the_program(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    program = [path.relative_to(REPOSITORY).as_posix() for path in program_files()]
    assert held == {name if name.startswith("shukotsu/") else f"shukotsu/{name}" for name in program}


@pytest.mark.slow
def test_the_wheel_runs_a_study_outside_the_checkout(wheel: Path, tmp_path: Path) -> None:
    """The environment has the users' lock, which provides all dependencies of the wheel."""
    programs = environment(tmp_path / "own", wheel)
    pip = (programs / "python", "-m", "pip", "--quiet")
    study = tmp_path / "study"
    sheets = study / "data" / "demo"
    sheets.mkdir(parents=True)
    (study / "study.yaml").write_text(SMALL_STUDY)
    lines = (REPOSITORY / "data" / "demo" / "recordings.tsv").read_text("utf-8").splitlines()
    rows = [line.replace("../data/demo", "data/demo") for line in lines[:2]]
    (sheets / "recordings.tsv").write_text("\n".join(rows) + "\n")
    installed = sorted((tmp_path / "own").rglob("shukotsu/**/*.tsv"))

    assert "report: results/small/report.html" in run(programs / "shukotsu", "run", folder=study)
    read = "len(shukotsu.read('results/small/joint_centres.parquet'))"
    code = f"import shukotsu; print({read}, shukotsu.__file__)"
    rows_read, home = run(programs / "python", "-c", code, folder=study).split()
    assert int(rows_read) > 0
    assert Path(home).is_relative_to(tmp_path / "own")
    snakefile = run(programs / "shukotsu", "doctor", "--snakefile", folder=study).strip()
    again = ("--snakefile", snakefile, "--configfile", "study.yaml", "--cores", "1")
    run(programs / "python", "-m", "snakemake", *again, folder=study)
    assert sorted((tmp_path / "own").rglob("shukotsu/**/*.tsv")) == installed
    assert not list((tmp_path / "own").rglob("*.arrows"))

    run(*pip, "uninstall", "--yes", "shukotsu", folder=study)
    assert not (programs / "shukotsu").exists()


@pytest.mark.slow
def test_the_recorder_needs_only_three_packages(wheel: Path, tmp_path: Path) -> None:
    programs = environment(tmp_path / "own", wheel, *RECORDER)
    shukotsu, port = programs / "shukotsu", tmp_path / "port"
    command = [shukotsu, "emulate", "--pty", port, "--stations", "1-2"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as emulator:
        try:
            assert emulator.stdout is not None
            assert emulator.stdout.readline()
            run(shukotsu, "record", "--devices", folder=tmp_path)
            assert "LIBERTY" in run(shukotsu, "record", "--ask", "--port", port, folder=tmp_path)
            run(shukotsu, "record", "--port", port, "--out", "a.arrows", "--duration", "1", folder=tmp_path)
            described = run(shukotsu, "inspect", "a.arrows", folder=tmp_path)
        finally:
            emulator.terminate()
    assert "records of each station: 1: " in described


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clone") / "shukotsu"
    run("git", "clone", "--quiet", REPOSITORY, folder, folder=REPOSITORY)
    return folder


@pytest.mark.slow
def test_the_workflow_meets_the_rules_of_snakemakes_catalogue(clone: Path) -> None:
    """The catalogue requires certain files and keys, and a workflow that passes `snakemake --lint`."""
    readme = (clone / "README.md").read_text("utf-8").lower()
    assert "snakemake" in readme
    assert "workflow" in readme
    assert (clone / "config" / "README.md").is_file()
    usage = yaml.safe_load((clone / ".snakemake-workflow-catalog.yml").read_text("utf-8"))["usage"]
    assert set(usage["mandatory-flags"]) == {"desc", "flags"}
    assert set(usage["software-stack-deployment"]) == {"conda", "apptainer", "report"}
    programs = Path(sys.executable).parent
    run(programs / "snakemake", "--lint", "--snakefile", "workflow/Snakefile", folder=clone)


@pytest.mark.slow
def test_the_workflow_can_be_a_module_of_another(clone: Path, tmp_path: Path) -> None:
    """Its study is a key of the other workflow's configuration; a faulty one is refused in one sentence."""
    (tmp_path / "Snakefile").write_text(MODULE.replace("SNAKEFILE", str(clone / "workflow" / "Snakefile")))
    config = {"hands": yaml.safe_load(SMALL_STUDY) | {"recordings": "recordings.tsv"}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    (tmp_path / "recordings.tsv").write_text(
        "subject\thand\ttask\trole\tfile\n01\tright\trom\tboth\t"
        "data/demo/recordings/sub-01_hand-right_task-rom.arrows\n"
    )
    snakemake = Path(sys.executable).with_name("snakemake")
    run(snakemake, "--cores", "1", folder=tmp_path)
    assert (tmp_path / "results" / "small" / "sub-01" / "plan.json").is_file()
    assert yaml.safe_load((tmp_path / "small.module.yaml").read_text("utf-8")) == config["hands"]

    (tmp_path / "config.yaml").write_text("hands: {study: small}\n")
    wrong = subprocess.run([snakemake, "-n"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert wrong.returncode == 1
    assert "config: the key 'recordings', 'layout', 'models' is missing" in wrong.stdout
    assert "Traceback" not in wrong.stdout + wrong.stderr
