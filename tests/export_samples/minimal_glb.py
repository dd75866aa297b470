"""A small strict reader of GLB, from the glTF 2.0 specification and scipy's rotations, not from our writer.

It knows what a skeleton's file may hold, refuses what the specification forbids there, and works out where
nodes and the vertices of their skins are.
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


def demand(true: object, words: str) -> None:
    """Raise ValueError with the words where something does not hold."""
    if not true:
        raise ValueError(words)


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
        """Nodes below the scene's node of that name, by their names, which are each there once."""
        found: dict[str, int] = {}
        todo = list(self.json["nodes"][self.names.index(name)]["children"])
        while todo:
            index = todo.pop()
            demand(self.names[index] not in found, f"{self.names[index]} twice below {name}")
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
            demand((known[rows] == at).all(), "a time without a key")
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
        demand((weight == np.array([255, 0, 0, 0])).all(), "a vertex that rides on several joints")
        joints = np.array(self.json["skins"][made["skin"]]["joints"])
        return joints[self.arrays[attributes["JOINTS_0"]][:, 0]]

    def _ordered(self) -> list[int]:
        order = [i for i, above in enumerate(self.parents) if above < 0]
        for index in order:
            order += self.json["nodes"][index].get("children", [])
        demand(sorted(order) == list(range(len(self.parents))), "nodes that are no trees")
        return order


def read_glb(path: Path) -> Glb:
    """Read a whole file; ValueError where it is not as the specification says."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    demand((magic, version, length) == (b"glTF", 2, len(data)), f"header {magic!r} {version} {length}")
    size, kind = struct.unpack_from("<I4s", data, 12)
    demand(kind == b"JSON" and size % 4 == 0, f"first chunk {kind!r} of {size}")
    content = json.loads(data[20 : 20 + size].decode("utf-8"), parse_constant=_refuse)
    bin_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    start = 28 + size
    demand(kind == b"BIN\0" and start + bin_size == len(data) and bin_size % 4 == 0, f"chunk {kind!r}")
    demand(content["asset"]["version"] == "2.0", "version")
    demand([b["byteLength"] for b in content["buffers"]] == [bin_size], "length of the buffer")
    arrays = [_array(content, accessor, data[start:]) for accessor in content["accessors"]]
    parents = [-1] * len(content["nodes"])
    for index, node in enumerate(content["nodes"]):
        for child in node.get("children", []):
            demand(parents[child] < 0, f"node {child} has two parents")
            parents[child] = index
    roots = [i for i, above in enumerate(parents) if above < 0]
    demand(sorted(content["scenes"][content["scene"]]["nodes"]) == roots, "a root that is not in the scene")
    made = Glb(content, arrays, parents)
    _check(made)
    return made


def _refuse(word: str) -> None:
    raise ValueError(f"{word} in the JSON")


def _array(content: dict[str, Any], accessor: dict[str, Any], data: bytes) -> np.ndarray:
    view = content["bufferViews"][accessor["bufferView"]]
    dtype, shape = TYPES[accessor["componentType"]], SHAPES[accessor["type"]]
    width = dtype.itemsize * int(np.prod(shape))
    demand(view["byteOffset"] % 4 == 0, "a view that is not aligned")
    demand("target" not in view or view["target"] == 34963 or width % 4 == 0, "a vertex that is not aligned")
    demand(view["byteLength"] == accessor["count"] * width > 0, "a view of another length than its accessor")
    demand(view["byteOffset"] + view["byteLength"] <= len(data), "a view beyond the buffer")
    values = np.frombuffer(data, dtype, accessor["count"] * int(np.prod(shape)), view["byteOffset"])
    values = values.reshape(-1, *shape)
    if dtype.kind == "f":
        demand(np.isfinite(values).all(), "a number that is none")
    if "min" in accessor:
        demand(accessor["min"] == np.atleast_1d(values.min(0)).tolist(), "min")
        demand(accessor["max"] == np.atleast_1d(values.max(0)).tolist(), "max")
    return values


def _check(glb: Glb) -> None:
    """What the specification demands of skins, meshes and animations."""
    content = glb.json
    for animation in content["animations"]:
        targets = [(c["target"]["node"], c["target"]["path"]) for c in animation["channels"]]
        demand(len(set(targets)) == len(targets), "a path with two channels")
        for sampler in animation["samplers"]:
            times, values = glb.arrays[sampler["input"]], glb.arrays[sampler["output"]]
            demand("min" in content["accessors"][sampler["input"]], "times without bounds")
            demand(times.ndim == 1 and times[0] >= 0 and (np.diff(times) > 0).all(), "times that do not grow")
            demand(len(values) == len(times) and sampler["interpolation"] == "LINEAR", "keys and times")
        for channel in animation["channels"]:
            values = glb.arrays[animation["samplers"][channel["sampler"]]["output"]]
            if channel["target"]["path"] == "rotation":
                length = np.linalg.norm(values.astype(float), axis=-1)
                demand(values.shape[1:] == (4,) and np.abs(length - 1).max() < 1e-6, "a rotation")
            else:
                demand(channel["target"]["path"] == "translation" and values.shape[1:] == (3,), "a path")
    for skin in content["skins"]:
        inverse = glb.arrays[skin["inverseBindMatrices"]]
        demand(len(inverse) == len(skin["joints"]) == len(set(skin["joints"])), "joints of a skin")
        demand((inverse[:, :, 3] == np.array([0, 0, 0, 1])).all(), "a last row")
        roots = [j for j in skin["joints"] if glb.parents[j] not in skin["joints"]]
        demand(roots == [skin["skeleton"]], "a skin whose skeleton is not its root")
    for mesh in content["meshes"]:
        for primitive in mesh["primitives"]:
            attributes = {name: glb.arrays[i] for name, i in primitive["attributes"].items()}
            demand(
                "min" in content["accessors"][primitive["attributes"]["POSITION"]], "places without bounds"
            )
            demand(len({len(values) for values in attributes.values()}) == 1, "attributes of a vertex")
            normal = np.linalg.norm(attributes["NORMAL"].astype(float), axis=-1)
            demand(np.abs(normal - 1).max() < 1e-5, "a normal that is not of length 1")
            demand(glb.arrays[primitive["indices"]].max() < len(normal), "a triangle without its vertex")
            demand(0 <= primitive["material"] < len(content["materials"]), "a material")
