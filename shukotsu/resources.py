"""What the program has beside its code: the Snakefile, stages, schemas, configuration, the demo's data."""

from pathlib import Path

PROGRAM = "shukotsu"
VERSION = "0.2.0"

PACKAGE = Path(__file__).resolve().parent

IN_CHECKOUT = (PACKAGE.parent / "Snakefile").is_file()
"""Whether this is a checkout; an installed wheel has the same folders inside the package."""

ROOT = PACKAGE.parent if IN_CHECKOUT else PACKAGE
"""Folder in which Snakefile, stages/, schemas/, config/, data/ and profiles/ lie."""
