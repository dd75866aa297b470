"""Streams of XDF files: what is refused before pyxdf is given a byte."""

import gzip
from pathlib import Path

import pytest
from event_files import marker_stream, xdf_of

from shukotsu.errors import InputError
from shukotsu.tables import xdf_streams
from shukotsu.tables.xdf_streams import read_streams

CUES = marker_stream(1, "cues", [["go"]], [1.0])


def _file(folder: Path, data: bytes) -> Path:
    path = folder / "a.xdf"
    path.write_bytes(data)
    return path


def test_a_packed_file_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xdf_streams, "MEMORY_BYTES", 1000)
    with pytest.raises(InputError, match=r"more than 0 MB; unpack it with gunzip to an \.xdf file"):
        read_streams(_file(tmp_path, gzip.compress(xdf_of(CUES) + bytes(100_000))))
