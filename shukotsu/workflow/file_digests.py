"""SHA-256 digests of files, cached between runs for files whose size and times are unchanged."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.resources import IN_CHECKOUT, ROOT, VERSION
from shukotsu.tables.digests import file_sha256, file_state
from shukotsu.tables.whole_files import write_text

CACHE = Path(".snakemake", "shukotsu-files.json")

STAMP = ".snakemake_timestamp"
"""File that Snakemake puts into a folder that is an output; its time is used as the folder's."""
SETTLED_NS = 60 * 10**9
"""A file that changed less than this before its digest was computed is read again: if the file system's clock
is coarse or that of another computer, a later change may not show in the file's times."""
CHANGED = "changed since the last run"
"""How an input differs that is the same file as in the last run, or the program."""


def program_digest(root: Path = ROOT) -> str:
    """Return the program's version, in a checkout followed by a digest of its code and schemas."""
    if not IN_CHECKOUT:
        return VERSION
    digest = hashlib.sha256()
    for folder in ("shukotsu", "stages", "schemas"):
        for path in sorted((root / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return f"{VERSION} {digest.hexdigest()[:16]}"


class FileDigests:
    """SHA-256 of files; a file is read again only if its file-system state has changed."""

    def __init__(self, cache: Path = CACHE) -> None:
        self._cache = cache
        self._has_new = False
        self._read: dict[str, str] = {}
        self._digests: dict[str, tuple[list[int], int, str]] = {}
        self._last_run: dict[str, dict[str, str]] = {}
        # a cache that is absent or of another structure is ignored
        with suppress(OSError, ValueError, TypeError, AttributeError, RecursionError):
            digests, runs = json.loads(cache.read_text("utf-8"))
            self._digests = {
                path: ([*state], int(at_ns), digest) for path, (state, at_ns, digest) in digests.items()
            }
            self._last_run = {study: dict(contents) for study, contents in runs.items()}

    def of(self, paths: Iterable[str]) -> str:
        """Return a digest of the names and contents of files."""
        contents = {path: self.sha256(path) for path in paths}
        return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:16]

    def sha256(self, path: str) -> str:
        """Return the SHA-256 of a file's content, or, if it cannot be read, the reason.

        The stage that reads the file reports the error.
        """
        if path not in self._read:
            try:  # only regular files: reading a pipe might never end
                self._read[path] = self._digest(path) if Path(path).is_file() else "no file"
            except OSError as error:
                self._read[path] = error.strerror or "unreadable"
        return self._read[path]

    def _digest(self, path: str) -> str:
        state = list(file_state(Path(path)))
        former, read_ns, digest = self._digests.get(path, ([], 0, ""))
        if former != state or read_ns - state[-1] <= SETTLED_NS:
            self._has_new = True
            read_ns, digest = time.time_ns(), file_sha256(Path(path))
            self._digests[path] = state, read_ns, digest
        return digest

    def content(self, path: str) -> str:
        """Return the digest of a file, or of all files below a folder except Snakemake's time stamp."""
        if not Path(path).is_dir():
            return self.sha256(path)
        files = (file for file in Path(path).rglob("*") if file.is_file())
        return self.of(file.as_posix() for file in files if file.name != STAMP)

    def changes(self, study: str, contents: Mapping[str, str]) -> dict[str, str]:
        """Return the inputs that differ from those of the study's last run, with how; store their state.

        They changed, or were added to the study or removed from it. If there was no run before, none differs.
        """
        before = self._last_run.get(study, contents)
        self._last_run[study] = dict(contents)
        self._has_new = True
        self.save()
        kinds = {name: CHANGED if name in before else "added to the study" for name in contents}
        differing = (name for name in {**contents, **before} if before.get(name) != contents.get(name))
        return {name: kinds.get(name, "removed from the study") for name in differing}

    def save(self) -> None:
        """Write the cache if any of its digests is new."""
        if self._has_new:
            digests = {path: entry for path, entry in self._digests.items() if Path(path).exists()}
            with suppress(OSError, InputError):  # without a cache, the next run reads all files again
                write_text(self._cache, json.dumps([digests, self._last_run], sort_keys=True))
