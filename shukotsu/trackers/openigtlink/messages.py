"""OpenIGTLink's messages: a header, big-endian, and a body whose CRC-64 (ECMA-182, from 0) it has.

Source: the OpenIGTLink protocol's specification, versions 1 to 3. From header version 2 on an extended header
stands before a body's content, and metadata (keys and values) stand behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.protocols.records import Bytes, Wholes

HEADER = np.dtype(
    [
        ("version", ">u2"),
        ("kind", "S12"),
        ("name", "S20"),
        ("seconds", ">u4"),
        ("fraction", ">u4"),
        ("size", ">u8"),
        ("crc", ">u8"),
    ]
)
HEADER_BYTES = HEADER.itemsize

TOOL_BYTES = {b"TDATA": 70, b"QTDATA": 50}
"""Kinds of messages that have a whole frame -> bytes of a tool: its name (20), type, 0, and its numbers."""

BODY_BYTES = {b"TRANSFORM": (48,), b"POSITION": (28, 24, 12)}
"""Kinds of messages that have one tool's pose -> lengths that its numbers can have."""

_POLYNOMIAL = 0x42F0E1EBA9EA3693


@cache
def _registers() -> npt.NDArray[np.uint64]:
    """CRC of each byte."""
    register = np.arange(256, dtype=np.uint64) << np.uint64(56)
    for _ in range(8):
        top = register >> np.uint64(63)
        register = (register << np.uint64(1)) ^ top * np.uint64(_POLYNOMIAL)
    return register


def crc64(rows: Bytes) -> npt.NDArray[np.uint64]:
    """CRC-64 of N stretches of bytes, (N, length); zeros before a stretch change nothing."""
    table, register = _registers(), np.zeros(len(rows), np.uint64)
    for column in np.ascontiguousarray(rows.T):
        register = (register << np.uint64(8)) ^ table[(register >> np.uint64(56)) ^ column]
    return register


def framed(kind: bytes, names: Sequence[bytes], bodies: Bytes, stamp_ns: Wholes) -> Bytes:
    """Give N messages of version 1, (N, bytes), of bodies (N, bytes) and stamps in UTC (N,), 0 for none."""
    header = np.zeros(len(bodies), HEADER)
    header["version"], header["kind"], header["name"] = 1, kind, names
    header["seconds"] = stamp_ns // 1_000_000_000
    header["fraction"] = -(-(stamp_ns % 1_000_000_000 << 32) // 1_000_000_000)
    header["size"], header["crc"] = bodies.shape[1], crc64(bodies)
    return np.concatenate([header.view(np.uint8).reshape(len(bodies), -1), bodies], 1)


def stamps_ns(headers: npt.NDArray[np.void]) -> Wholes:
    """Give the stamps of headers, UTC, (N,); 0 where the sender does not stamp."""
    fraction = headers["fraction"].astype(np.int64)
    return np.asarray(headers["seconds"].astype(np.int64) * 1_000_000_000 + (fraction * 1_000_000_000 >> 32))
