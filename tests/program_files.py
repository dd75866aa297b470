"""Files of the program as they are installed: the package, and what at the top is linked into it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = REPOSITORY / "shukotsu"
LINKED = sorted(path.name for path in PACKAGE.iterdir() if path.is_symlink())
"""Names of folders and files at the top that are part of the package."""


def package_files(folder: Path = PACKAGE, suffix: str = "") -> Iterator[Path]:
    """Return every file of the package through the links, sorted; none that a run has left."""
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name not in ("__pycache__", "recordings"):
            yield from package_files(path, suffix)
        elif path.is_file() and path.name.endswith(suffix):
            yield path
