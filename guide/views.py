"""From where a hand is seen, and its solid shapes as outlines of a flat picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guide.flesh import Flesh, Joined, Part
from skeleton.rotations import Array, unit


@dataclass(frozen=True)
class View:
    """A view from far away. right, up, towards : (3,) unit, the picture's directions in the hand's frame.

    scale : px per mm. origin_px : (2,) where the wrist centre is.
    """

    right: Array
    up: Array
    towards: Array
    scale: float
    origin_px: tuple[float, float]

    @classmethod
    def seen(
        cls,
        towards: tuple[float, float, float],
        up: tuple[float, float, float],
        scale: float,
        origin_px: tuple[float, float],
    ) -> View:
        """From a point far away in direction `towards`, with `up` upward."""
        near = unit(np.array(towards))
        upward = unit(np.array(up) - (np.array(up) @ near) * near)
        return cls(np.cross(upward, near), upward, near, scale, origin_px)

    def px(self, points_mm: Array) -> Array:
        """Places (..., 2) of points (..., 3), y downward."""
        flat = np.stack([points_mm @ self.right, -(points_mm @ self.up)], -1)
        return np.asarray(flat * self.scale + np.array(self.origin_px))

    def depth_mm(self, points_mm: Array) -> float:
        """How near to the viewer points are on average."""
        return float((points_mm @ self.towards).mean())


def in_order(view: View, parts: Sequence[Part]) -> list[Part]:
    """Parts from the farthest to the nearest, on average over time."""
    return sorted(parts, key=lambda part: view.depth_mm(part.points_mm))


def outline(view: View, part: Part) -> list[str]:
    """The part's outline as path data, one a frame, with the same commands in all."""
    pieces = []
    for one in part.capsules:
        radii_px = [np.full((len(one.first_mm), 1), radius * view.scale) for radius in one.radii_mm]
        pieces.append(_capsule_paths(view.px(one.first_mm), view.px(one.second_mm), *radii_px))
    pieces += [_polygon_paths(view.px(one)) for one in part.polygons]
    return ["".join(piece) for piece in zip(*pieces, strict=True)]


def patch(view: View, joined: Joined, earlier: int, inset_px: float) -> list[str]:
    """What covers the line between two parts: from the joint along the part drawn earlier (0 or 1).

    Where that part points at the viewer, or away, there is no such line, and it shrinks to nothing.
    """
    way = unit(joined.towards[earlier])
    across = np.hypot(way @ view.right, way @ view.up)[:, None]
    radius_px = (joined.radius_mm * view.scale - inset_px) * np.clip((across - 0.3) / 0.3, 0.05, 1.0)
    ends = view.px(joined.at_mm), view.px(joined.at_mm + way * (joined.radius_mm * 0.95))
    return _capsule_paths(*ends, radius_px, 0.97 * radius_px)


def _capsule_paths(first: Array, second: Array, big: Array, small: Array) -> list[str]:
    """Outlines of two discs (T, 2) with radii (T, 1), all in px, and of what lies between them."""
    along = second - first
    distance = np.linalg.norm(along, axis=-1, keepdims=True)
    along = np.where(distance > 1e-6, along / np.maximum(distance, 1e-6), [[0.0, -1.0]])
    distance = np.maximum(distance, np.abs(big - small) + 0.4)
    second = first + along * distance
    cos = (big - small) / distance
    sin = np.sqrt(1.0 - cos**2)
    across = np.stack([-along[:, 1], along[:, 0]], -1)
    right, left = cos * along + sin * across, cos * along - sin * across
    large = int((big > small).any())
    return [
        f"M{a}A{r} {r} 0 {large} 1 {b}L{c}A{s} {s} 0 0 1 {d}Z"
        for r, s, a, b, c, d in zip(
            map(number, big[:, 0]),
            map(number, small[:, 0]),
            *map(
                texts,
                (first + big * right, first + big * left, second + small * left, second + small * right),
            ),
            strict=True,
        )
    ]


def _polygon_paths(corners: Array) -> list[str]:
    """Closed polygons (T, n, 2), all the same way round as capsules are, or else they would cut holes."""
    x, y = corners[..., 0], corners[..., 1]
    area = (x * np.roll(y, -1, -1) - np.roll(x, -1, -1) * y).sum(-1)
    turned = np.where(area[:, None, None] < 0, corners[:, ::-1], corners)
    return closed_paths(turned)


def closed_paths(corners: Array) -> list[str]:
    """Polygons (T, n, 2) as path data, one a frame."""
    return ["M" + "L".join(texts(frame)) + "Z" for frame in corners]


def line_paths(places: Array) -> list[str]:
    """Open lines (T, n, 2) as path data, one a frame."""
    return ["M" + "L".join(texts(frame)) for frame in places]


def dot_paths(places: Array) -> list[str]:
    """Points (T, n, 2) as path data that a round pen makes dots of, one a frame."""
    return ["".join(f"M{place}h0" for place in texts(frame)) for frame in places]


def texts(places: Array) -> list[str]:
    """Places (n, 2) as `x y`, to a tenth of a pixel."""
    return [f"{number(x)} {number(y)}" for x, y in places]


def number(value: float) -> str:
    """A number to a tenth, without what says nothing."""
    text = f"{value:.1f}"
    text = text.removesuffix(".0")
    return "0" if text == "-0" else text


def whole(view: View, hand: Flesh) -> tuple[Array, Array]:
    """Corners (2,) of the box around the hand in all frames, px."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    for part in hand.parts:
        for one in part.capsules:
            for end, radius in zip((one.first_mm, one.second_mm), one.radii_mm, strict=True):
                places = view.px(end)
                low = np.minimum(low, places.min(0) - radius * view.scale)
                high = np.maximum(high, places.max(0) + radius * view.scale)
    return low, high
