"""What the program has beside its code: the Snakefile, stages, schemas, configuration, the demo's data."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent

IN_CHECKOUT = (PACKAGE.parent / "Snakefile").is_file()
"""Whether the program runs from a checkout; an installed wheel carries the same folders inside the package."""

ROOT = PACKAGE.parent if IN_CHECKOUT else PACKAGE
"""Folder in which Snakefile, stages/, schemas/, config/, data/ and profiles/ lie."""
