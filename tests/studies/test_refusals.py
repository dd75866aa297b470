"""A study that is wrong is refused in one sentence, nothing written."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from studies.running import snakemake, write_study

from shukotsu.workflow import one_run

pytestmark = pytest.mark.slow

ROW = "01\tright\trom\tboth\trom.parquet"


def _snakemake(folder: Path) -> subprocess.CompletedProcess[str]:
    return snakemake(folder, "--directory", str(folder), "--configfile", str(folder / "study.yaml"))


def test_a_bad_study_file_is_refused(tmp_path: Path) -> None:
    """What the tests of the schemas refuse in all its forms reaches whoever runs Snakemake."""
    study = write_study(tmp_path, "study", [ROW], ["paper-fig4"])
    study.file.write_text(study.file.read_text().replace("models:", "modles:"))
    done = _snakemake(tmp_path)
    assert done.returncode == 1
    (sentence,) = re.findall(r"^WorkflowError in file .*\n(.*)\n", done.stderr + done.stdout, re.MULTILINE)
    for words in ("study.yaml", "'modles'", "did you mean 'models'"):
        assert words in sentence
    assert "Traceback" not in done.stderr + done.stdout
    assert not (tmp_path / "results").exists()


def test_a_study_file_that_is_no_yaml_is_refused(tmp_path: Path) -> None:
    """By Snakemake, which reads it before the Snakefile does; hence with its own words and exit code."""
    (tmp_path / "study.yaml").write_text("models: [rigid\n")
    done = _snakemake(tmp_path)
    assert done.returncode == 1
    assert "not valid JSON or YAML" in done.stderr
    assert not (tmp_path / "results").exists()


def test_a_run_beside_a_live_one_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(one_run, "_held", {})
    one_run.hold(Path("results", "study"))
    second = write_study(tmp_path, "study", [ROW], ["rigid"]).snakemake()
    assert second.returncode == 2
    assert second.stderr.splitlines()[-1].startswith("error: study study: another run of it is under way")
    assert "Traceback" not in second.stderr
