"""Recordings read from files of any format, and files that are refused; for the tests of the readers."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout, read_layout
from shukotsu.schemas.mapping import mapping_from_config
from shukotsu.stages.capture.formats.readers import find_reader
from shukotsu.stages.capture.samples import Samples

EXAMPLES = int(os.environ.get("RECORDING_EXAMPLES", "8"))
"""Random recordings of each format that a test makes; a thousand are made by hand."""
ARM = read_layout("arm")
LIBERTY = read_layout("liberty16")


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


def of(samples: Samples, segment: str) -> np.ndarray:
    """Which samples are that segment's, (N,)."""
    return samples.segment == samples.segments.index(segment)
