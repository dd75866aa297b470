"""Recordings read from files of any format, and files that are refused; for the tests of the readers."""

from __future__ import annotations

import random
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.readers.formats.readers import find_reader
from shukotsu.readers.samples import Samples
from shukotsu.study.layout import Layout, read_layout
from shukotsu.study.mapping import mapping_from_config
from shukotsu.tables.catalogue import GAINS
from shukotsu.tables.typed_table import Provenance, columns_from_rows, write_table

ARM = read_layout("arm")
LIBERTY = read_layout("liberty16")


def damaged(data: bytes) -> dict[str, bytes | None]:
    """What may have become of a file, by what happened to it; None where a folder has its name."""
    chance = random.Random(3)
    flipped = bytearray(data)
    if data:
        flipped[len(data) // 2] ^= 4
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder, "gains.parquet")
        write_table(other, GAINS, columns_from_rows(GAINS, []), Provenance())
        table = other.read_bytes()
    return {
        "random bytes": chance.randbytes(1000),
        "empty": b"",
        "cut": data[: len(data) // 2],
        "one bit": bytes(flipped),
        "a folder": None,
        "another table": table,
        "a recording": b"frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,hand,1,2,3,1,0,0,0\n",
    }


def read(path: Path, layout: Layout = ARM, mapping: dict[str, Any] | None = None) -> Samples:
    """Read a recording by the content of a mapping, or by its ending."""
    checked = None if mapping is None else mapping_from_config(mapping, "mapping.yaml")
    return find_reader(path, "auto", checked)(path, layout, checked)


def refuse(path: Path, message: str, layout: Layout = ARM, mapping: dict[str, Any] | None = None) -> None:
    """Check that reading fails with one sentence that has the message, a text or a pattern, in it."""
    with pytest.raises(InputError) as caught:
        read(path, layout, mapping)
    sentence = str(caught.value)
    assert message in sentence or re.search(message, sentence), sentence
    assert "\n" not in sentence


def write_c3d(path: Path, points: np.ndarray, labels: Sequence[str], first: int = 1) -> Path:
    """Write a C3D file of 50 Hz in mm; points : (T, P, 3), first : number of the first frame."""
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = [*labels]
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1).transpose(2, 1, 0)
    file["header"]["points"]["first_frame"] = first - 1
    file.write(str(path))
    return path


def of(samples: Samples, segment: str) -> np.ndarray:
    """Which samples are that segment's, (N,)."""
    return samples.segment == samples.segments.index(segment)
