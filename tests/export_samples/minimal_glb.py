"""A small reader of GLB, from the glTF 2.0 specification and scipy's rotations, not from our writer.

It works out where nodes and the vertices of their skins are; what the specification forbids, the validator of
the Khronos Group finds (`test_glb_in_other_programs.py`).
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

TYPES = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5125: np.dtype("<u4"), 5126: np.dtype("<f4")}
SHAPES: dict[str, tuple[int, ...]] = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}


@dataclass
class Glb:
    """A file: its JSON, its accessors' values, and for every node its parent (-1: none)."""

    json: dict[str, Any]
    arrays: list[np.ndarray]
    parents: list[int]

    @property
    def names(self) -> list[str]:
        """Names of the nodes."""
        return [node["name"] for node in self.json["nodes"]]

    def below(self, name: str) -> dict[str, int]:
        """Nodes below the scene's node of that name, by their names."""
        found: dict[str, int] = {}
        todo = list(self.json["nodes"][self.names.index(name)]["children"])
        while todo:
            index = todo.pop()
            found[self.names[index]] = index
            todo += self.json["nodes"][index].get("children", [])
        return found

    def keys(self, animation: int = 0) -> dict[tuple[int, str], tuple[np.ndarray, np.ndarray]]:
        """Times and values of an animation by node and path."""
        made = self.json["animations"][animation]
        samplers = [
            (self.arrays[s["input"]], self.arrays[s["output"]].astype(float)) for s in made["samplers"]
        ]
        return {(c["target"]["node"], c["target"]["path"]): samplers[c["sampler"]] for c in made["channels"]}

    def posed(self, times: np.ndarray | None = None, animation: int = 0) -> np.ndarray:
        """World matrices (T, N, 4, 4) of all nodes at times that have a key; None: as they stand (T = 1)."""
        at = np.zeros(1) if times is None else times.astype(np.float32)
        keys = {}
        for target, (known, values) in {} if times is None else self.keys(animation).items():
            rows = np.searchsorted(known, at)
            keys[target] = values[rows]
        out = np.tile(np.eye(4), (len(at), len(self.names), 1, 1))
        for index in self._ordered():
            node = self.json["nodes"][index]
            turn = keys.get((index, "rotation"), np.array([node.get("rotation", [0.0, 0.0, 0.0, 1.0])]))
            local = np.tile(np.eye(4), (len(at), 1, 1))
            local[:, :3, :3] = Rotation.from_quat(turn).as_matrix()
            local[:, :3, 3] = keys.get((index, "translation"), node.get("translation", [0.0, 0.0, 0.0]))
            above = self.parents[index]
            out[:, index] = out[:, above] @ local if above >= 0 else local
        return out

    def vertices(self, posed: np.ndarray, node: int) -> np.ndarray:
        """Vertices (T, V, 3) of a node's skinned mesh; its own place counts for nothing."""
        made = self.json["nodes"][node]
        skin = self.json["skins"][made["skin"]]
        inverse = self.arrays[skin["inverseBindMatrices"]].astype(float).transpose(0, 2, 1)
        attributes = self.json["meshes"][made["mesh"]]["primitives"][0]["attributes"]
        place = self.arrays[attributes["POSITION"]].astype(float)
        weight = self.arrays[attributes["WEIGHTS_0"]] / 255
        moved = posed[:, skin["joints"]] @ inverse
        each = moved[:, self.arrays[attributes["JOINTS_0"]]]
        whole = np.concatenate([place, np.ones((len(place), 1))], -1)
        return np.einsum("vk,tvkij,vj->tvi", weight, each[..., :3, :], whole)

    def riders(self, node: int) -> np.ndarray:
        """The node that each vertex (V,) of a node's mesh rides on with all its weight."""
        made = self.json["nodes"][node]
        attributes = self.json["meshes"][made["mesh"]]["primitives"][0]["attributes"]
        weight = self.arrays[attributes["WEIGHTS_0"]]
        assert (weight == np.array([255, 0, 0, 0])).all(), "a vertex that rides on several joints"
        joints = np.array(self.json["skins"][made["skin"]]["joints"])
        return joints[self.arrays[attributes["JOINTS_0"]][:, 0]]

    def _ordered(self) -> list[int]:
        order = [i for i, above in enumerate(self.parents) if above < 0]
        for index in order:
            order += self.json["nodes"][index].get("children", [])
        return order


def read_glb(path: Path) -> Glb:
    """Read a whole file."""
    data = path.read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    (size,) = struct.unpack_from("<I", data, 12)
    content = json.loads(data[20 : 20 + size].decode("utf-8"))
    arrays = [_array(content, accessor, data[28 + size :]) for accessor in content["accessors"]]
    parents = [-1] * len(content["nodes"])
    for index, node in enumerate(content["nodes"]):
        for child in node.get("children", []):
            parents[child] = index
    return Glb(content, arrays, parents)


def _array(content: dict[str, Any], accessor: dict[str, Any], data: bytes) -> np.ndarray:
    view = content["bufferViews"][accessor["bufferView"]]
    dtype, shape = TYPES[accessor["componentType"]], SHAPES[accessor["type"]]
    values = np.frombuffer(data, dtype, accessor["count"] * int(np.prod(shape)), view["byteOffset"])
    return values.reshape(-1, *shape)
