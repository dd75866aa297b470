"""Digests of files: computed from contents, and again only if the file system reports a change."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from snakemake.persistence import file as persistence

from shukotsu.resources import VERSION
from shukotsu.workflow import file_digests, former_results
from shukotsu.workflow.file_digests import CHANGED, FileDigests, program_digest


@pytest.fixture(autouse=True)
def reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """List to which the names of read files are added; the working directory has one file, `a`."""
    monkeypatch.chdir(tmp_path)
    Path("a").write_text("one")
    names: list[str] = []
    read = file_digests.file_sha256

    def counted(path: Path) -> str:
        names.append(path.name)
        return read(path)

    monkeypatch.setattr(file_digests, "file_sha256", counted)
    return names


def kept_digest(*paths: str) -> str:
    digests = FileDigests(Path("cache.json"))
    digest = digests.of(paths)
    digests.changes("study", {path: digests.sha256(path) for path in paths})
    return digest


def same_size_and_time() -> None:
    before = Path("a").stat()
    Path("a").write_text("two")
    os.utime("a", ns=(before.st_atime_ns, before.st_mtime_ns))


def moved_here() -> None:
    Path("b").write_text("two")
    os.utime("b", (0, 0))
    Path("b").rename("a")


@pytest.mark.parametrize("change", [same_size_and_time, moved_here, lambda: Path("a").unlink()])
def test_a_changed_replaced_or_removed_file_is_noticed(
    reads: list[str], change: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_digests, "SETTLED_NS", 0)
    before = kept_digest("a")
    assert kept_digest("a") == before
    assert reads == ["a"], "read only once"
    change()
    assert kept_digest("a") != before


def test_a_recently_changed_file_is_read_again(reads: list[str]) -> None:
    """It may change again within one tick of a coarse clock, with the same times."""
    assert kept_digest("a") == kept_digest("a")
    assert reads == ["a", "a"]


def test_changes_since_the_last_run_are_listed() -> None:
    digests = FileDigests(Path("cache.json"))
    assert digests.changes("study", {"a": "1"}) == {}, "no change before the first run"
    digests.changes("study", {"a": "1", "b": "1", "c": "1"})
    again = FileDigests(Path("cache.json"))
    after = again.changes("study", {"a": "1", "b": "2", "d": "1"})
    assert after == {"b": CHANGED, "d": "added to the study", "c": "removed from the study"}
    assert again.changes("another", {"a": "1"}) == {}


NOTES = ("{}", "3", "null", "[1]", '[[], {"a": 1}]', '[{"a": [1, 2, 3]}, {}]', '[{"outputs": 3}]')


@pytest.mark.parametrize("text", [*NOTES, "[" * 10**5])
def test_invalid_cache_files_are_ignored(text: str) -> None:
    Path("notes.json").write_text(text)
    digests = FileDigests(Path("notes.json"))
    assert digests.changes("study", {"a": digests.sha256("a")}) == {}
    Path("notes.json").write_text(text)
    changed = former_results.recall(Path("notes.json"), ["a"], [], FileDigests(Path("other.json")))
    assert changed == (["a"], [])


def test_results_that_an_interrupted_run_left_are_not_called_changed() -> None:
    """Snakemake marks the outputs of a job from its start until it has recorded its end."""
    persistence.FilePersistence()._mark_incomplete("a", None)
    Path("b").write_text("made, and changed since")
    outputs, digests = ["a", "b", "not made"], FileDigests(Path("cache.json"))
    assert former_results.recall(Path("none.json"), outputs, [], digests) == (["b"], ["a"])
    assert persistence.FilePersistence()._read_record("a") is None


def test_the_programs_digest_is_its_version_or_files_of_a_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_digests, "IN_CHECKOUT", False)
    assert program_digest(tmp_path) == VERSION
    monkeypatch.setattr(file_digests, "IN_CHECKOUT", True)
    (tmp_path / "stages").mkdir()
    digests = set()
    for text in ("x = 1", "x = 2"):
        (tmp_path / "stages/a.py").write_text(text)
        digests.add(program_digest(tmp_path))
    assert len(digests) == 2
    assert all(digest.startswith(f"{VERSION} ") for digest in digests)
