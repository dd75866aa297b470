"""Files are written atomically, also if the writer is killed."""

import errno
import os
from pathlib import Path

import pytest

from shukotsu.errors import InputError, StorageError
from shukotsu.tables.typed_table import Provenance
from shukotsu.tables.whole_files import files_in, write_text


def test_a_failed_write_leaves_the_file_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "before")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "whole until \ud800")
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_only_a_regular_file_is_replaced(tmp_path: Path) -> None:
    """Otherwise root could replace a device file, which would be lost for all programs."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path):
        with pytest.raises(StorageError, match=r"cannot be written .is a folder or a device.; name a file"):
            write_text(path, "")
    assert (tmp_path / "pipe").is_fifo()


def test_a_file_is_synced_before_its_renaming_and_its_folder_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    happened: list[str] = []
    replace = Path.replace

    def synced(descriptor: int) -> None:
        happened.append(f"synced {Path(f'/proc/self/fd/{descriptor}').readlink().name}")

    def replaced(path: Path, target: Path) -> Path:
        happened.append(f"renamed {path.name}")
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", replaced)
    write_text(tmp_path / "a.txt", "text")
    temporary = f".a.txt.{os.getpid()}.tmp"
    assert happened == [f"synced {temporary}", f"renamed {temporary}", f"synced {tmp_path.name}"]


def test_a_file_that_cannot_be_synced_is_not_renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Network file systems report a full disk only when a file is synced."""
    path = tmp_path / "a.txt"
    write_text(path, "before")

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=r"cannot be written \(No space left on device\)"):
        write_text(path, "after")
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_the_temporary_file_of_a_killed_writer_is_removed_later(tmp_path: Path) -> None:
    left = tmp_path / ".a.txt.4194305.tmp"
    others = [tmp_path / name for name in (".a.txt.b.7.tmp", ".aatxt.7.tmp", ".b.txt.7.tmp", ".a.txt.unit")]
    for path in (left, *others):
        path.write_text("half")
    write_text(tmp_path / "a.txt", "whole")
    assert sorted(tmp_path.iterdir()) == sorted([tmp_path / "a.txt", *others])


@pytest.mark.parametrize("length", [200, 230, 255])
def test_a_name_may_be_as_long_as_the_file_system_allows(tmp_path: Path, length: int) -> None:
    """A longer name is an input error, not a storage error."""
    write_text(tmp_path / ("a" * length), "text")
    assert [path.name for path in tmp_path.iterdir()] == ["a" * length]
    with pytest.raises(InputError, match="File name too long") as caught:
        write_text(tmp_path / ("a" * 256), "text")
    assert not isinstance(caught.value, StorageError)


def test_hidden_files_are_ignored_in_a_folder(tmp_path: Path) -> None:
    for name in ("b.csv", "a.csv", ".a.csv.7.tmp", ".b.csv.swp"):
        (tmp_path / name).write_text(name)
    (tmp_path / "folder").mkdir()
    assert [path.name for path in files_in(tmp_path)] == ["a.csv", "b.csv"]
    assert [name for name, _ in Provenance.of([tmp_path]).inputs] == ["a.csv", "b.csv"]
