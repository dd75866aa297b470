"""The page of licences: those of the packages in the run-time lock, as installed packages state them."""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from schemas.files import write_text

ROOT = Path(__file__).parents[1]
LOCK, PAGE = ROOT / "requirements.lock", ROOT / "docs" / "licences.md"
ELSEWHERE = {"greenlet": "MIT AND PSF-2.0", "pyreadline3": "BSD"}
"""Of packages that some systems install and others do not."""
LONGEST = 80
"""Letters of the name of a licence; a longer text is the licence itself."""
_LOCKED = re.compile(r"^([a-z0-9.-]+)==([^\s;]+)", re.MULTILINE)

HEAD = """# Licences

What `requirements.lock` installs beside this program (MIT), as the packages state it themselves. `make docs`
writes this page; a package that states no licence stops it.

| licence | packages |
|---|---|
"""


def page() -> str:
    """The page. Raises LookupError where a package states no licence."""
    versions: dict[str, list[str]] = {}
    for name, version in _LOCKED.findall(LOCK.read_text("utf-8")):
        versions.setdefault(name, []).append(version)
    packages: dict[str, list[str]] = {}
    for name, every in versions.items():
        packages.setdefault(licence(name), []).append(f"{name} {' or '.join(every)}")
    rows = [f"| {name} | {', '.join(those)} |" for name, those in sorted(packages.items())]
    return HEAD + "\n".join(rows) + "\n"


def licence(name: str) -> str:
    """The licence of an installed package: its expression, else its name, its classes or its file's title."""
    try:
        found = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        if name in ELSEWHERE:
            return ELSEWHERE[name]
        raise
    said: Any = found.metadata
    stated: list[str | None] = [said.get("License-Expression"), said.get("License")]
    classes = [each for each in said.get_all("Classifier", []) if each.startswith("License ::")]
    stated.append(" or ".join(each.rpartition(" :: ")[2] for each in classes))
    stated += [_title(Path(str(file.locate()))) for file in found.files or () if file.name == "LICENSE"]
    for each in stated:
        if each and len(each) <= LONGEST and "\n" not in each and each.upper() != "UNKNOWN":
            return each
    raise LookupError(f"{name}: states no licence")


def _title(file: Path) -> str:
    """The first line of a file of a licence; empty where it is no title."""
    first = file.read_text("utf-8").strip().partition("\n")[0].strip()
    return first.removesuffix(" License") if first.endswith("License") else ""


def main() -> int:
    """Write the page."""
    write_text(PAGE, page())
    return 0


if __name__ == "__main__":
    sys.exit(main())
