"""What the Snakefile asks of a study with sessions: each is a unit of its own."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from workflow.study_files import StudyFiles

SHEET = """subject\tsession\thand\ttask\trole\tfile\tevents
01\t1\tright\trom\tboth\tmade/sub-01_ses-1_hand-right_task-rom.parquet\t
01\ta b\tright\trom\tboth\tmade/sub-01_ses-a%20b_hand-right_task-rom.parquet\tkeys.mid
"""
SECOND = SimpleNamespace(subject="01_ses-a%20b", hand="right", recording="rom", model="rigid")


def test_each_session_has_its_plan_files_and_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "recordings.tsv").write_text(SHEET)
    (tmp_path / "keys.mid").write_bytes(b"MThd")
    (tmp_path / "study.yaml").write_text(
        "study: s\nrecordings: recordings.tsv\nlayout: liberty16\nmodels: [rigid]\n"
        "simulation: {folder: made, seed: 3}\n"
    )
    study = StudyFiles(Path("study.yaml"))
    assert study.plans == [f"results/s/sub-01_ses-{name}/plan.json" for name in ("1", "a%20b")]
    assert study.subject_options(SECOND) == "--subject=01 '--session=a b'"
    assert study.recording_files(SECOND) == ["made/sub-01_ses-a%20b_hand-right_task-rom.parquet"]
    assert study.truth(SECOND)[0].startswith("made/sub-01_ses-a%20b_hand-right_task-rom_truth/")
    assert "'--session=a b'" in study.import_options(SECOND)
    assert study.event_files(SECOND) == ["keys.mid"]
    first = SimpleNamespace(subject="01_ses-1")
    assert study.event_files(first) == []
    assert study.plan(SECOND) != study.plan(first)
