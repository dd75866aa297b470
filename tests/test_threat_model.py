"""What docs/threat-model.md promises of a study folder from a stranger, where no room's own tests hold it."""

from __future__ import annotations

import ast
import os
import pickle
import shlex
import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from program_files import PACKAGE, package_files
from small_study import write_study
from studies.running import REPOSITORY

from shukotsu.commands.check_file import main as check_study
from shukotsu.errors import InputError
from shukotsu.stages.capture.__main__ import main as capture
from shukotsu.workflow.study_files import StudyFiles

RUNS_CODE = {
    "eval",
    "exec",
    "compile",
    "__import__",
    "pickle",
    "dill",
    "shelve",
    "marshal",
    "joblib",
    "runpy",
}
UNSAFE = {("yaml", "load"), ("yaml", "unsafe_load"), ("yaml", "full_load"), ("os", "system"), ("os", "popen")}
ROW = "1 right rom both a.csv"
RECORDING = ["--layout=liberty16", "--subject=1", "--hand=right", "--task=rom"]


class Payload:
    """What leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return open, (str(self.mark), "w")


def names_in(tree: ast.AST) -> set[str]:
    """What a module calls by a bare name, imports, or passes as `allow_pickle=True` or `shell=True`."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name):
                found.add(node.func.id)
            if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
                found |= {".".join(pair) for pair in UNSAFE if pair == (node.func.value.id, node.func.attr)}
            for word in node.keywords:
                on = isinstance(word.value, ast.Constant) and word.value.value is True
                found |= {word.arg} if on and word.arg in ("allow_pickle", "shell") else set()
        elif isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.module or "").split(".")[0])
    return found


def test_nothing_that_is_read_is_run() -> None:
    """No module of the program evaluates text, unpickles or gives a line to a shell."""
    forbidden = RUNS_CODE | {".".join(pair) for pair in UNSAFE} | {"allow_pickle", "shell"}
    odd = {
        str(path.relative_to(PACKAGE)): names
        for path in package_files(suffix=".py")
        if (names := names_in(ast.parse(path.read_text("utf-8"))) & forbidden)
    }
    assert odd == {}


@pytest.mark.parametrize(
    "name", ["a.npy", "a.pkl", "a.mat", "a.csv", "a.parquet", "a.arrows", "a.c3d", "a.xdf"]
)
def test_a_pickle_is_not_unpickled(tmp_path: Path, name: str) -> None:
    mark = tmp_path / "mark"
    (tmp_path / name).write_bytes(pickle.dumps(Payload(mark)))
    for command in (
        ["import", f"--in={tmp_path / name}", *RECORDING, f"--out={tmp_path / 'poses.parquet'}"],
        ["inspect", str(tmp_path / name)],
    ):
        assert capture(command) == 2
    assert not mark.exists()


def test_a_type_of_column_that_brings_a_pickle_is_not_unpickled(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    metadata = {
        b"ARROW:extension:name": b"arrow.py_extension_type",
        b"ARROW:extension:metadata": pickle.dumps(Payload(mark)),
    }
    pq.write_table(
        pa.table([[1]], pa.schema([pa.field("frame", pa.int64(), metadata=metadata)])), tmp_path / "a.parquet"
    )
    assert capture(["inspect", str(tmp_path / "a.parquet")]) in (0, 2)
    assert not mark.exists()


@pytest.mark.parametrize(
    "text", ["!!python/object/apply:os.system ['touch mark']", "!!python/name:os.system"]
)
def test_yaml_makes_no_objects(
    tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    study = write_study(tmp_path, ROW, more=f"corrections: {text}\n")
    assert check_study([str(study)]) == 2
    assert "not valid YAML" in capsys.readouterr().err
    assert not (tmp_path / "mark").exists()


def test_the_check_reads_a_study_that_snakemake_would_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    study = write_study(tmp_path, ROW, more='"__use_\\u0079te__": true\n')
    assert check_study([str(study)]) == 2
    assert "unknown key '__use_yte__'" in capsys.readouterr().err
    assert check_study([str(tmp_path / "absent.yaml")]) == 2
    assert "no such file; expected a study file" in capsys.readouterr().err


def test_the_check_names_what_is_read_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By a path, or by a link in the folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "stranger"
    study = write_study(folder, ROW, "1 left rom both ../own.csv", "2 left rom both link.csv")
    (folder / "link.csv").symlink_to(tmp_path / "other.csv")
    assert check_study([str(study)]) == 0
    said = capsys.readouterr().out
    elsewhere = f"reads 2 files in {tmp_path.resolve()}, outside the study's folder: other.csv, own.csv"
    assert [line for line in said.splitlines() if "outside" in line] == [f"note: {elsewhere}"]


@pytest.mark.parametrize("linked", [False, True])
def test_recordings_are_simulated_into_no_folder_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, linked: bool
) -> None:
    """There they would replace what has their names."""
    for name in ("run", "stranger", "recordings"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "run")
    target = "../recordings"
    if linked:
        (tmp_path / "stranger/link").symlink_to("../recordings")
        target = "link"
    study = write_study(tmp_path / "stranger", ROW, more=f"simulation: {{folder: {target}, seed: 1}}\n")
    with pytest.raises(InputError, match=r"simulation.folder: .* is neither below the study file's folder"):
        StudyFiles(study)


def test_words_of_a_study_stay_words_on_a_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = "'; touch mark; $(touch mark) `touch mark` {mark}"
    more = yaml.safe_dump({"exports": ["bvh"], "export_settings": {"licence": words}})
    files = StudyFiles(write_study(tmp_path, ROW, more=more))
    assert f"--licence={words}" in shlex.split(files.export_options)


@pytest.mark.parametrize("name", ["../../a", "..", "/etc/passwd", "~", "-rf"])
def test_results_stay_below_the_folder_of_the_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    files = StudyFiles(write_study(tmp_path, f"{name} right {name} both a.csv {name}"))
    for path in (*files.tables, *files.plans, *files.study_tables, *files.figures, *files.subject_pages):
        assert Path(path).resolve().is_relative_to(tmp_path / "results" / "test")
        assert ".." not in Path(path).parts


@pytest.mark.slow
def test_no_job_imports_what_lies_in_the_folder_that_it_runs_in(tmp_path: Path) -> None:
    for module in ("numpy", "yaml", "json", "pyarrow"):
        (tmp_path / f"{module}.py").write_text(
            f"open('mark-{module}', 'w')\nraise SystemExit('not that one')\n"
        )
    study = write_study(tmp_path, ROW)
    program = [Path(sys.executable).with_name("snakemake"), "-s", REPOSITORY / "Snakefile", "--cores=1"]
    words = [*program, "results/test/sub-1/plan.json", "--configfile", study]
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        words, cwd=tmp_path, env=own, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob("mark-*"))
