"""Streams of XDF files: what is refused before pyxdf is given a byte, and when it raises."""

import gzip
from pathlib import Path

import pytest
import pyxdf
from event_files import marker_stream, xdf_of

from shukotsu.errors import InputError
from shukotsu.files import xdf_streams
from shukotsu.files.xdf_streams import load_stream, read_streams

CUES = marker_stream(1, "cues", [["go"]], [1.0])


def _file(folder: Path, data: bytes) -> Path:
    path = folder / "a.xdf"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"<channel_count>1<", b"<channel_count>0<", "channel_count is '0'; expected a whole number above 0"),
        (b"<info><name>cues", b"<inga><name>cues", "header of stream 1: is damaged"),
        (b"<info>", b"<inFo>", "holds 'inFo'; expected 'info'"),
    ],
)
def test_headers_that_no_recorder_writes(tmp_path: Path, old: bytes, new: bytes, message: str) -> None:
    data = CUES.replace(old, new).replace(b"</info>", b"</inFo>" if new == b"<inFo>" else b"</info>")
    with pytest.raises(InputError, match=message):
        read_streams(_file(tmp_path, xdf_of(data)))


def test_a_packed_file_that_unpacks_to_too_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xdf_streams, "MEMORY_BYTES", 1000)
    with pytest.raises(InputError, match=r"more than 0 MB; unpack it with gunzip to an \.xdf file"):
        read_streams(_file(tmp_path, gzip.compress(xdf_of(CUES) + bytes(100_000))))


def test_what_pyxdf_cannot_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise KeyError("x")

    path = _file(tmp_path, xdf_of(CUES))
    (stream,) = read_streams(path)
    monkeypatch.setattr(pyxdf, "load_xdf", fail)
    with pytest.raises(InputError, match="stream cues: pyxdf cannot read it"):
        load_stream(path, stream)
