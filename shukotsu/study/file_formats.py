"""Formats of recordings: the one registry that readers, `new`, `inspect`, sheets and mappings go by."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FileFormat:
    """A file format of recordings. Functions are named MODULE.FUNCTION, imported when they are needed.

    endings : of files in this format. reader : function of `readers/formats` that reads it, with or without a
    mapping; it takes path, layout and mapping, and returns Samples or an iterator of Samples, part by part.
    what : a file that a mapping is for, in the guide's page of keys; empty where there is none.
    mapped_reader : function that reads it by a mapping, where that is another. needs_mapping : whether it is
    read by one only. inspector : function of `readers/inspection` that describes a file by a layout; empty
    where `inspect` cannot. receiver_keys : keys of a mapping's receiver that are read. needs_no_orientation :
    subject and verb of the sentence that refuses a mapping's key `orientation`; empty where it is needed.
    takes_study_mapping : whether the mapping that a study file names is for such files too.
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
        inspector="text_tables.describe_parquet",
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
"""Formats that say themselves what their numbers are."""
MAPPED = {name: form.what for name, form in FORMATS.items() if form.what}
"""Formats that can be read by a mapping, which says which, and what a file in each is."""


def format_of(path: Path) -> FileFormat | None:
    """Return the format that a file's ending means; None where it means none."""
    return next((form for form in FORMATS.values() if path.name.lower().endswith(form.endings)), None)


def function_of(package: str, name: str) -> Callable[..., Any]:
    """Import a function of the registry; package : of its module, by its whole name."""
    module, _, function = name.partition(".")
    imported: Callable[..., Any] = getattr(importlib.import_module(f"{package}.{module}"), function)
    return imported
