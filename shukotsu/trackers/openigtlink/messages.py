"""OpenIGTLink's messages: a header, big-endian, and a body whose CRC-64 (ECMA-182, from 0) it has.

Source: the OpenIGTLink protocol's specification, versions 1 to 3. From header version 2 on an extended header
stands before a body's content, and metadata (keys and values) stand behind it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.protocols.records import Bytes, Wholes

_FIELDS = ("version", "kind", "name", "seconds", "fraction", "size", "crc")
HEADER = np.dtype(list(zip(_FIELDS, (">u2", "S12", "S20", ">u4", ">u4", ">u8", ">u8"), strict=True)))
HEADER_BYTES = HEADER.itemsize

TOOL_BYTES = {b"TDATA": 70, b"QTDATA": 50}
"""Kinds of messages that have a whole frame -> bytes of a tool: its name (20), type, 0, and its numbers."""

BODY_BYTES = {b"TRANSFORM": (48,), b"POSITION": (28, 24, 12)}
"""Kinds of messages that have one tool's pose -> lengths that its numbers can have."""

_REGISTERS = np.arange(256, dtype=np.uint64) << np.uint64(56)
"""CRC of each byte."""
for _ in range(8):
    _REGISTERS = _REGISTERS << np.uint64(1) ^ (_REGISTERS >> np.uint64(63)) * np.uint64(0x42F0E1EBA9EA3693)


def crc64(b: Bytes, first: Wholes, last: Wholes) -> npt.NDArray[np.uint64]:
    """CRC-64 of N stretches of bytes, first..last (N,); quickest where all are as long."""
    register = np.zeros(len(first), np.uint64)
    for back in range(int((last - first).max(initial=0)), 0, -1):  # zeros before a stretch change nothing
        byte = np.where(last - first < back, 0, b[np.maximum(last - back, 0)])
        register = (register << np.uint64(8)) ^ _REGISTERS[(register >> np.uint64(56)) ^ byte]
    return register


def framed(kind: bytes, names: Sequence[bytes], bodies: Bytes, stamp_ns: Wholes) -> Bytes:
    """Give N messages of version 1, (N, bytes), of bodies (N, bytes) and stamps in UTC (N,), 0 for none."""
    header = np.zeros(len(bodies), HEADER)
    header["version"], header["kind"], header["name"] = 1, kind, names
    header["seconds"] = stamp_ns // 1_000_000_000
    header["fraction"] = -(-(stamp_ns % 1_000_000_000 << 32) // 1_000_000_000)
    ends = np.arange(1, len(bodies) + 1) * bodies.shape[1]
    header["size"], header["crc"] = bodies.shape[1], crc64(bodies.ravel(), ends - bodies.shape[1], ends)
    return np.concatenate([header.view(np.uint8).reshape(len(bodies), -1), bodies], 1)
