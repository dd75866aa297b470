"""A hand drawn into a picture, still or moving: flesh, and in it bones and joints."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from guide.flesh import Flesh, Part
from guide.picture_card import ACCENT, BONE, JOINT, NAIL, SKIN, SKIN_LINE, Drawing
from guide.views import View, closed_paths, dot_paths, in_order, line_paths, number, outline, patch
from skeleton.rotations import Array
from stages.simulate.random_hand import BONES, FINGERS, JOINTS

_BONE_MM, _JOINT_MM = 2.9, 4.2
_MARKED = 1.3
"""How much larger a joint is that is pointed out."""


@dataclass(frozen=True)
class HandDrawing:
    """A hand in a drawing, which moves once around in so many seconds.

    marked : joints to point out. bones : whether
    what is in the flesh is drawn. line_px : width of outlines.
    """

    drawing: Drawing
    view: View
    hand: Flesh
    seconds: float = 0.0
    marked: Collection[str] = ()
    bones: bool = True
    line_px: float = 1.8

    def draw(self) -> None:
        """From the farthest part to the nearest, each over the line where it passes into the one before."""
        parts = in_order(self.view, self.hand.parts)
        drawn: set[str] = set()
        for part in parts:
            self._path(
                outline(self.view, part),
                f'fill="{SKIN}" stroke="{SKIN_LINE}" stroke-width="{number(2 * self.line_px)}" '
                'paint-order="stroke"',
            )
            drawn.add(part.name)
            own = [one for one in self.hand.joined if part.name in one.parts and drawn.issuperset(one.parts)]
            for joined in own:
                earlier = 1 - joined.parts.index(part.name)
                self._path(patch(self.view, joined, earlier, 0.2), f'fill="{SKIN}"')
                if self.bones:
                    self._bones([joined.covered_bone(earlier)])
            self._nails(part)
            if self.bones:
                self._bones([line for _, line in part.bones])
                self._joints([one.joint for one in own])
                if part.name == "palm":
                    self._joints([joint for joint in _IN_PALM if joint in self._shown])

    @property
    def _shown(self) -> set[str]:
        """Joints that are drawn: the wrist and the fingers' bases only where they are pointed out."""
        return {joint for joint in JOINTS if joint in self.marked or joint not in (*_FINGER_BASES, "wrist")}

    def _path(self, frames: list[str], attributes: str) -> None:
        self.drawing.path(frames, attributes, self.seconds)

    def _bones(self, lines: list[Array]) -> None:
        pieces = [line_paths(self.view.px(line)) for line in lines]
        width = number(_BONE_MM * self.view.scale)
        frames = ["".join(frame) for frame in zip(*pieces, strict=True)]
        self._path(frames, f'fill="none" stroke="{BONE}" stroke-width="{width}"')

    def _joints(self, joints: list[str]) -> None:
        for marked in (False, True):
            own = [joint for joint in joints if (joint in self.marked) == marked]
            if own:
                bones = [BONES[JOINTS.index(joint) + 1] for joint in own]
                places = np.stack([self.view.px(self.hand.at(bone, np.zeros(3))) for bone in bones], 1)
                size = self.view.scale * _JOINT_MM * (_MARKED if marked else 1.0)
                self.drawing.dots(dot_paths(places), size, ACCENT if marked else JOINT, self.seconds)

    def _nails(self, part: Part) -> None:
        """Where the back of the finger faces the viewer; else the nail shrinks to nothing."""
        for corners, dorsal in part.nails:
            facing = np.clip(4.0 * (dorsal @ self.view.towards), 0.0, 1.0)[:, None, None]
            if not facing.any():
                continue
            middle = corners.mean(1, keepdims=True)
            frames = closed_paths(self.view.px(middle + facing * (corners - middle)))
            self._path(frames, f'fill="{NAIL}" stroke="{SKIN_LINE}" stroke-width="1" stroke-opacity=".6"')


_FINGER_BASES = tuple(f"{finger}_cmc" for finger in FINGERS)
_IN_PALM = ("wrist", "thumb_cmc", *_FINGER_BASES)
