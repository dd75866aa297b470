"""A small reader of BVH, from the format's description and scipy's rotations, not from our writer."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass
class Node:
    """A joint or (name empty) an end site; rotations (T,) of scipy and positions (T, 3), in the world."""

    name: str
    parent: int
    offset: np.ndarray
    channels: list[str] = field(default_factory=list)


@dataclass
class Bvh:
    """Nodes in the file's order, seconds a frame, the numbers (T, C), and each node's world pose."""

    nodes: list[Node]
    frame_time_s: float
    numbers: np.ndarray
    position: np.ndarray
    rotation: list[Rotation]

    def series(self, name: str) -> np.ndarray:
        """Positions (T, 3) of the joint of that name."""
        return self.position[:, [node.name for node in self.nodes].index(name)]

    def end(self, parent: str) -> np.ndarray:
        """Positions (T, 3) of the end site of that joint."""
        names = [node.name for node in self.nodes]
        wanted = names.index(parent)
        return self.position[
            :, next(i for i, n in enumerate(self.nodes) if n.parent == wanted and not n.name)
        ]


def read_bvh(path: Path) -> Bvh:
    """Read a whole file."""
    head, _, motion = path.read_text("ascii").partition("MOTION\n")
    nodes = _nodes(head.split())
    lines = motion.splitlines()
    frames, seconds = int(lines[0].removeprefix("Frames:")), float(lines[1].removeprefix("Frame Time:"))
    numbers = np.array([[float(word) for word in line.split(" ")] for line in lines[2:]])
    assert numbers.shape == (frames, sum(len(node.channels) for node in nodes))
    return Bvh(nodes, seconds, numbers, *_posed(nodes, numbers))


def _nodes(words: list[str]) -> list[Node]:
    assert words.pop(0) == "HIERARCHY"
    nodes: list[Node] = []
    open_nodes: list[int] = []
    while words:
        word = words.pop(0)
        if word == "}":
            open_nodes.pop()
            continue
        name, brace, offset = (words.pop(0) for _ in range(3))
        assert (brace, offset) == ("{", "OFFSET")
        node = Node("" if word == "End" else name, open_nodes[-1] if open_nodes else -1, np.empty(0))
        node.offset = np.array([float(words.pop(0)) for _ in range(3)])
        if word != "End":
            assert words.pop(0) == "CHANNELS"
            node.channels = [words.pop(0) for _ in range(int(words.pop(0)))]
        open_nodes.append(len(nodes))
        nodes.append(node)
    return nodes


def _posed(nodes: list[Node], numbers: np.ndarray) -> tuple[np.ndarray, list[Rotation]]:
    """Position channels stand for OFFSET; rotations multiply in the order of the channels."""
    position, rotation, column = [], [], 0
    for node in nodes:
        own = {c: numbers[:, column + i] for i, c in enumerate(node.channels)}
        column += len(node.channels)
        place = np.tile(node.offset, (len(numbers), 1))
        for axis, name in enumerate(("Xposition", "Yposition", "Zposition")):
            place[:, axis] = own.get(name, place[:, axis])
        turn = Rotation.identity(len(numbers))
        for name, degrees in own.items():
            if name.endswith("rotation"):
                turn = turn * Rotation.from_euler(name[0].lower(), degrees[:, None], degrees=True)
        if node.parent >= 0:
            place = position[node.parent] + rotation[node.parent].apply(place)
            turn = rotation[node.parent] * turn
        position.append(place)
        rotation.append(turn)
    return np.stack(position, 1), rotation
