"""Registry of the file formats of recordings, used by readers, sheets, mappings, `new` and `inspect`."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FileFormat:
    """A file format of recordings. Functions are named as MODULE.FUNCTION and imported when they are needed.

    Attributes
    ----------
    endings
        File name endings of this format.
    reader
        Function in `readers/formats` that reads a file, with or without a mapping. It takes path, layout and
        mapping, and returns Samples or an iterator over parts of them.
    what
        What a mapping of this format reads, in the guide's words; empty if there are no such mappings.
    mapped_reader
        Function that reads a file by a mapping, if `reader` does not.
    needs_mapping
        Whether a file can only be read by a mapping.
    inspector
        Function in `readers/inspection` that describes a file; empty if `inspect` has none.
    receiver_keys
        Keys that a receiver can have in a mapping.
    needs_no_orientation
        Subject and verb of the message that rejects a mapping's key `orientation`; empty if it is allowed.
    takes_study_mapping
        Whether the mapping that the study file names applies to files of this format.

    """

    endings: tuple[str, ...]
    reader: str
    what: str = ""
    mapped_reader: str = ""
    needs_mapping: bool = False
    inspector: str = ""
    receiver_keys: tuple[str, ...] = ("value",)
    needs_no_orientation: str = ""
    takes_study_mapping: bool = True


FORMATS = {
    "csv": FileFormat(
        (".csv", ".tsv", ".txt"),
        "tidy.read_csv",
        "any table as text",
        mapped_reader="mapped_csv.read_mapped_csv",
        inspector="text_tables.describe_text",
    ),
    "parquet": FileFormat(
        (".parquet", ".pq"),
        "tidy.read_parquet",
        inspector="tidy_files.describe_parquet",
        takes_study_mapping=False,
    ),
    "capture": FileFormat(
        (".arrows",),
        "raw_capture.read_capture",
        "a raw capture (`.arrows`), for which only the receivers have to be given",
        takes_study_mapping=False,
    ),
    "xdf": FileFormat((".xdf", ".xdfz"), "xdf.read_xdf", "a LabStreamingLayer recording"),
    "sequence": FileFormat(
        (".mha", ".nrrd"),
        "sequence.read_sequence",
        "a sequence file of PLUS or 3D Slicer (.mha, .nrrd)",
        needs_no_orientation="a sequence's transforms need",
    ),
    "c3d": FileFormat(
        (".c3d",),
        "c3d.read_c3d",
        "markers or ROTATION",
        needs_mapping=True,
        inspector="c3d_files.describe_c3d",
        receiver_keys=("markers", "rotation"),
        needs_no_orientation="a C3D file needs",
    ),
}
AUTO = "auto"
UNMAPPED = tuple(name for name, form in FORMATS.items() if not form.needs_mapping)
"""Formats that can be read without a mapping because they define units and columns themselves."""
MAPPED = {name: form.what for name, form in FORMATS.items() if form.what}
"""Formats that a mapping can name under `format`, each with a description of its files."""


def format_of(path: Path, name: str = AUTO) -> FileFormat | None:
    """Return the format with this name or, for AUTO, that of the file's ending; None if it is unknown."""
    if name != AUTO:
        return FORMATS[name]
    return next((form for form in FORMATS.values() if path.name.lower().endswith(form.endings)), None)


def function_of(package: str, name: str) -> Callable[..., Any]:
    """Import a function by its MODULE.FUNCTION name in the registry; package : full name of its package."""
    module, _, function = name.partition(".")
    imported: Callable[..., Any] = getattr(importlib.import_module(f"{package}.{module}"), function)
    return imported
