"""`make audit`: a known advisory fails it, no answer does not, and is never taken for a good one."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent
SKIPPED = {"name": "b", "skip_reason": "Dependency not found on PyPI"}
SOUND = {"name": "a", "version": "1", "vulns": []}
KNOWN = {"name": "a", "version": "1", "vulns": [{"id": "PYSEC-1", "fix_versions": ["2"]}]}


@pytest.fixture
def audit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program, with nothing installed and its last answer in a folder of the test."""
    spec = importlib.util.spec_from_file_location("audit", REPOSITORY / ".ci" / "audit.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "LAST_ANSWER", tmp_path / "last-answer")
    monkeypatch.setattr(module, "install", str)
    return module


def answer(monkeypatch: pytest.MonkeyPatch, audit: Any, *packages: dict[str, Any]) -> None:
    said = json.dumps({"dependencies": packages}), "1 known vulnerability"
    monkeypatch.setattr(audit, "_run", lambda command: ("", "") if "--dry-run" in command else said)


@pytest.mark.parametrize(
    ("packages", "code", "words"),
    [
        ([SOUND], 0, "audit: 1 packages, 0 known advisories"),
        ([KNOWN, SKIPPED], 1, "a 1: PYSEC-1, fixed in 2"),
        ([SOUND, SKIPPED], 0, "audit: could not ask about b"),
    ],
)
def test_an_answer(
    audit: Any,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    packages: list[dict[str, Any]],
    code: int,
    words: str,
) -> None:
    answer(monkeypatch, audit, *packages)
    assert audit.main() == code
    assert words in capsys.readouterr().out
    assert audit.LAST_ANSWER.read_text().endswith(", pypi")


def test_no_answer_is_said_and_fails_nothing(
    audit: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mirror that knows no advisories skips every package, which is no answer."""
    answer(monkeypatch, audit, SKIPPED)
    assert audit.main() == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("audit: could not ask for advisories (pypi: Dependency not found on PyPI; osv: ")
    assert line.endswith("the last answer: none yet")
    audit.LAST_ANSWER.write_text("2026-01-02, osv")
    monkeypatch.setattr(audit, "install", lambda: "no network")
    assert audit.main() == 0
    assert capsys.readouterr().out == (
        "audit: could not ask for advisories (no network); the last answer: 2026-01-02, osv\n"
    )


def test_a_lock_that_cannot_be_read_fails(
    audit: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else the audit would never come to ask, and never say why."""
    monkeypatch.setattr(audit, "_run", lambda _: ("", "a has duplicate requirements"))
    assert audit.main() == 1
    assert "the lock files cannot be read: a has duplicate requirements" in capsys.readouterr().out
