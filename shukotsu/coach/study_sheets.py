"""The sheets and the study file that people keep: rows and names are added, and every byte there stays."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from shukotsu.errors import InputError
from shukotsu.files import limits
from shukotsu.files.limits import read_whole
from shukotsu.files.text_files import decoded, reading
from shukotsu.files.whole_files import replacing
from shukotsu.schemas.config_files import loaded_yaml, read_config, yaml_text
from shukotsu.schemas.sheets import PARTICIPANTS, RECORDINGS, Sheet, read_sheet, sheet_rows

_BOM = b"\xef\xbb\xbf"


class HandDone(NamedTuple):
    """A hand of a study; done : whether the sheet has a recording that calibrates it, whose file is there."""

    subject: str
    hand: str
    done: bool


def hands_of(study: Path, hand: str | None = None, session: str = "") -> list[HandDone]:
    """Give both hands, or the one, of a study's subjects in a session: first those of its sheet of
    participants, recorded or not.

    Raises InputError as `read_config` and `read_sheet` do.
    """
    config, folder = read_config(study, "study"), study.parent
    recordings = read_sheet(folder / config["recordings"], RECORDINGS, further_columns(config))
    named = read_sheet(folder / config["participants"], PARTICIPANTS) if "participants" in config else []
    done = {
        (row["subject"], row["hand"])
        for row in recordings
        if row["role"] != "evaluation"
        and row["session"] == session
        and not row["exclude"]
        and (folder / row["file"]).exists()
    }
    hands = (hand,) if hand else ("right", "left")
    subjects = dict.fromkeys(row["subject"] for row in [*named, *recordings])
    return [HandDone(own, hand, (own, hand) in done) for own in subjects for hand in hands]


def further_columns(config: Mapping[str, Any]) -> list[str]:
    """Give columns of the sheet of recordings that a study's factors are read from."""
    return list(config["factors"])


def add_row(path: Path, sheet: Sheet, row: Mapping[str, Any]) -> None:
    """Add a row at a sheet's end, and at its header's end a column that only this row needs.

    A sheet that is absent is made. Raises InputError where the sheet with the row would be refused, as where
    its key stands there already, and StorageError where it cannot be written; the file is then as before.
    """
    cells = {name: "" if value is None else str(value) for name, value in row.items()}
    for name, text in cells.items():
        if re.search(r"[\t\r\n]", text) or text != text.strip():
            raise InputError(
                f"{path}: column {name}: {text!r} has tabs, line breaks or blanks around it; leave them out"
            )

    def with_row(text: str) -> str:
        parts = re.split(r"(\r\n|\r|\n)", text)  # lines and, between them, their ends
        at = next((i for i in range(0, len(parts), 2) if parts[i].strip()), len(parts) - 1)
        header = [cell.strip() for cell in parts[at].split("\t")] if parts[at].strip() else []
        needed = [name for name, cell in cells.items() if cell]
        if not header:
            needed = [cell.name for cell in sheet.cells if cell.required or cell.name in needed] + needed
        new = [name for name in dict.fromkeys(needed) if name not in header]
        parts[at] += "\t" * bool(header and new) + "\t".join(new)
        end = parts[1] if len(parts) > 1 else "\n"
        line = "\t".join(cells.get(name, "") for name in [*header, *new])
        whole = "".join(parts)
        added = whole + end * (not whole.endswith(("\n", "\r"))) + line + end
        sheet_rows(path, re.sub("\r\n?", "\n", added), sheet, header)
        return added

    _change(path, f"the sheet of {sheet.name}", with_row)


def name_sheet(study: Path, key: str, file: str) -> Path:
    """Name a sheet in a study file that names none of that key; give the sheet that it names then.

    Raises InputError where the line cannot be added without a change in what else the file says.
    """
    named = file

    def with_key(text: str) -> str:
        nonlocal named
        before = loaded_yaml(text, str(study))
        if isinstance(before, dict) and key in before:
            named = str(before[key])
            return text
        end = "\r\n" if "\r\n" in text else "\n"
        line = yaml_text({key: file}).strip()
        added = text + end * (not text.endswith("\n")) + line + end
        with suppress(InputError):
            if isinstance(before, dict) and loaded_yaml(added, str(study)) == {**before, key: file}:
                return added
        raise InputError(f"{study}: does not name the sheet of {key}; add the line `{line}` to it by hand")

    _change(study, "a study file", with_key, must_exist=True)
    return study.parent / named


def _change(path: Path, what: str, change: Callable[[str], str], *, must_exist: bool = False) -> None:
    """Write a text file anew as `change` has its text, if that is another; one process at a time."""
    path = Path(os.path.realpath(path))  # a link stays one
    with _alone(path):
        data = b""
        if must_exist or path.exists():
            with reading(path, what):
                data = read_whole(path, what, limits.SHEET_BYTES)
        text = decoded(path, data, what)
        changed = change(text)
        if changed == text:
            return
        with replacing(path) as temporary:
            temporary.write_bytes(_BOM * data.startswith(_BOM) + changed.encode())
            if path.exists():
                shutil.copymode(path, temporary)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock beside a file that ends with its process; where there are no locks, none is held."""
    lock = path.with_name(f".{path.name}.lock")
    try:
        import fcntl

        path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            file = lock.open("a")
            fcntl.flock(file, fcntl.LOCK_EX)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), lock.stat()):
                    break
            file.close()  # who held it before has removed it
    except (ImportError, OSError):
        yield
        return
    try:
        yield
    finally:
        lock.unlink(missing_ok=True)
        file.close()
