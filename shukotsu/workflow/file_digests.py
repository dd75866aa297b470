"""Know files by what is in them: their SHA-256, kept between runs under what the file system says of each."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.resources import IN_CHECKOUT, ROOT, VERSION
from shukotsu.tables.whole_files import file_sha256, file_state, write_text

CACHE = Path(".snakemake", "shukotsu-files.json")

STAMP = ".snakemake_timestamp"
"""Snakemake's file in a folder that is an output: its time is the folder's."""

SETTLED_NS = 60 * 10**9
"""A file that changed less than this before it was read is read again: where a file system counts in
seconds, or by another computer's clock, one more change may leave its times as they are."""


def program_digest(root: Path = ROOT) -> str:
    """Return the program's version; in a checkout, where code changes under it, and a digest of all files."""
    if not IN_CHECKOUT:
        return VERSION
    digest = hashlib.sha256()
    for folder in ("shukotsu", "stages", "schemas"):
        for path in sorted((root / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return f"{VERSION} {digest.hexdigest()[:16]}"


class FileDigests:
    """SHA-256 of files, read where the file system says that they changed since they were read last."""

    def __init__(self, cache: Path = CACHE) -> None:
        self._cache = cache
        self._has_new = False
        self._read: dict[str, str] = {}
        self._known: dict[str, tuple[list[int], int, str]] = {}
        self._last_run: dict[str, dict[str, str]] = {}
        with suppress(OSError, ValueError):
            self._known, self._last_run = json.loads(cache.read_text("utf-8"))

    def of(self, paths: Iterable[str]) -> str:
        """Digest of the names and the contents of files."""
        contents = {path: self.sha256(path) for path in paths}
        return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:16]

    def sha256(self, path: str) -> str:
        """Digest of what is in a file; where it cannot be read, the reason, which its reader will say too."""
        if path not in self._read:
            try:
                self._read[path] = self._digest(path)
            except OSError as error:
                self._read[path] = error.strerror or "unreadable"
        return self._read[path]

    def _digest(self, path: str) -> str:
        if not Path(path).is_file():
            return "no file"  # nor would a pipe ever end
        state = list(file_state(Path(path)))
        known, read_ns, digest = self._known.get(path, ([], 0, ""))
        if known == state and read_ns - state[-1] > SETTLED_NS:
            return digest
        self._has_new = True
        begun_ns = time.time_ns()
        digest = file_sha256(Path(path))
        self._known[path] = state, begun_ns, digest
        return digest

    def content(self, path: str) -> str:
        """Digest of what is in a file, or in all files below a folder but Snakemake's own."""
        if not Path(path).is_dir():
            return self.sha256(path)
        files = (file for file in Path(path).rglob("*") if file.is_file())
        return self.of(file.as_posix() for file in files if file.name != STAMP)

    def changes(self, study: str, contents: Mapping[str, str]) -> list[str]:
        """Names whose content is another than in the study's last run, or new or gone; none before."""
        before = self._last_run.get(study)
        if before is None:
            return []
        names = dict.fromkeys((*contents, *before))
        return [name for name in names if before.get(name) != contents.get(name)]

    def write(self, study: str, contents: Mapping[str, str]) -> None:
        """Keep what was read, and what the study is made from as it runs now."""
        self._last_run[study] = dict(contents)
        self._has_new = True
        self.save()

    def save(self) -> None:
        """Keep what was read, if anything was."""
        if not self._has_new:
            return
        known = {path: entry for path, entry in self._known.items() if Path(path).exists()}
        text = json.dumps([known, self._last_run], sort_keys=True)
        with suppress(OSError, InputError):  # a folder that cannot be written to costs time, and no more
            write_text(self._cache, text)
