"""Locations of the Snakefile, stages, schemas, configuration and demo data, in a checkout or a wheel."""

from pathlib import Path

PROGRAM = "shukotsu"
VERSION = "0.2.0"

PACKAGE = Path(__file__).resolve().parent

IN_CHECKOUT = (PACKAGE.parent / "Snakefile").is_file()
"""Whether the package is in a checkout; in an installed wheel the same folders are inside the package."""

ROOT = PACKAGE.parent if IN_CHECKOUT else PACKAGE
"""Folder that contains Snakefile, stages/, schemas/, config/, data/ and profiles/."""
