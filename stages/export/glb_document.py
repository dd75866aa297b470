"""The container: arrays become accessors of one binary chunk, the rest is JSON (glTF 2.0, section 4.4)."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shukotsu.errors import InputError
from shukotsu.files.whole_files import replacing

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
"""What a buffer view is for: attributes of vertices, and indices of them."""

_COMPONENTS = {"uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
LARGEST = 2**32 - 1


class Document:
    """A glTF asset under construction: its JSON, whose lists grow by `add`, and the pieces of its buffer."""

    def __init__(self, asset: dict[str, Any]) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0", **asset}}
        self._pieces: list[npt.NDArray[Any]] = []
        self._length = 0

    def add(self, kind: str, value: dict[str, Any]) -> int:
        """Put an object at the end of the list of its kind (nodes, meshes, ...); give its index."""
        values = self.json.setdefault(kind, [])
        values.append(value)
        return len(values) - 1

    def array(
        self, values: npt.NDArray[Any], *, target: int = 0, bounds: bool = False, normalized: bool = False
    ) -> int:
        """Index of a new accessor of the values, shape (N,) or (N, 3), (N, 4), (N, 4, 4), by columns.

        The type of the values is that of the accessor's components. target : what the buffer view is for, 0
        where it is not for vertices. bounds : with min and max.
        """
        data = np.ascontiguousarray(values)
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": data.nbytes}
        accessor: dict[str, Any] = {
            "bufferView": self.add("bufferViews", view | ({"target": target} if target else {})),
            "componentType": _COMPONENTS[data.dtype.name],
            "count": len(data),
            "type": {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}[data.shape[1:]],
        }
        if normalized:
            accessor["normalized"] = True
        if bounds:
            low, high = data.min(0), data.max(0)
            accessor |= {"min": np.atleast_1d(low).tolist(), "max": np.atleast_1d(high).tolist()}
        padding = np.zeros(-data.nbytes % 4, np.uint8)
        self._pieces += [data, padding]
        self._length += data.nbytes + len(padding)
        return self.add("accessors", accessor)

    def write(self, path: Path) -> None:
        """Write the asset as one GLB file; InputError where it is larger than GLB can be."""
        self.json["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self.json, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        whole = 12 + 8 + len(text) + 8 + self._length
        if whole > LARGEST:
            raise InputError(
                f"{path}: would have {whole} bytes, and GLB cannot have more than {LARGEST}; write fewer "
                "frames at a time with --frames"
            )
        with replacing(path) as temporary, temporary.open("wb") as stream:
            stream.write(struct.pack("<4sII", b"glTF", 2, whole))
            stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
            stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
            for piece in self._pieces:
                stream.write(piece.astype(piece.dtype.newbyteorder("<"), copy=False).data)
