"""Formats of recordings: names, endings, readers. A new format is one more line here and one module."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FileFormat:
    """One file format: the endings that mean it, and the reader's module in `readers/formats` and function.

    in_parts : whether the function gives the recording part by part, as a format can be long.
    """

    endings: tuple[str, ...]
    module: str
    function: str
    in_parts: bool = False


FORMATS = {
    "csv": FileFormat((".csv", ".tsv", ".txt"), "tidy", "read_csv", in_parts=True),
    "parquet": FileFormat((".parquet", ".pq"), "tidy", "read_parquet", in_parts=True),
    "capture": FileFormat((".arrows",), "raw_capture", "read_capture", in_parts=True),
    "xdf": FileFormat((".xdf", ".xdfz"), "xdf", "read_xdf"),
    "sequence": FileFormat((".mha", ".nrrd"), "sequence", "read_sequence"),
}
"""Formats that say themselves what their numbers are."""
MAPPED = {
    "csv": FileFormat((".csv", ".txt", ".tsv"), "mapped_csv", "read_mapped_csv"),
    "c3d": FileFormat((".c3d",), "c3d", "read_c3d"),
    "capture": FORMATS["capture"],
    "xdf": FORMATS["xdf"],
    "sequence": FORMATS["sequence"],
}
"""Formats that are read by a mapping; the mapping says which."""
AUTO = "auto"
