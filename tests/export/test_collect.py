"""Exports of all subjects in one folder."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from stage_runs import collect_exports as main


@pytest.mark.parametrize("links", [True, False])
def test_files_of_all_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, links: bool) -> None:
    """Hidden files stay; where the disk has no links files are copied; what is there is replaced."""
    for name in ("one/a.bvh", "one/.hidden", "two/b.bvh", "two/bids/sub-01/b.tsv", "out/a.bvh"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    if not links:
        monkeypatch.setattr(os, "link", _refuse)
    folders, out = [str(tmp_path / "one"), str(tmp_path / "two")], tmp_path / "out"
    assert main(["--folders", *folders, "--out", str(out)]) == 0
    texts = {path.relative_to(out).as_posix(): path.read_text() for path in out.rglob("*") if path.is_file()}
    expected = {"a.bvh": "one/a.bvh", "b.bvh": "two/b.bvh", "bids/sub-01/b.tsv": "two/bids/sub-01/b.tsv"}
    assert texts == expected
    assert (out / "a.bvh").samefile(tmp_path / "one" / "a.bvh") == links


def test_a_copy_that_fails_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And half a file under no name."""
    for name in ("one/a.bvh", "out/a.bvh"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(name)

    def half(_: Path, target: Path) -> None:
        target.write_text("ha")
        raise OSError("the disk is full")

    monkeypatch.setattr(os, "link", _refuse)
    monkeypatch.setattr(shutil, "copy2", half)
    assert main(["--folders", str(tmp_path / "one"), "--out", str(tmp_path / "out")]) == 2
    assert [path.read_text() for path in (tmp_path / "out").iterdir()] == ["out/a.bvh"]


def _refuse(*_: object) -> None:
    raise OSError("no links")
