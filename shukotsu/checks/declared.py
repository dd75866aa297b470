"""What was declared of a recording's numbers: its mapping's units, orders and senses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shukotsu.study.findings import Values

SENSES = ("receiver-to-transmitter", "transmitter-to-receiver")
"""Senses of rotations; those of the second are inverted as they are read."""


@dataclass(frozen=True)
class Declared:
    """What a mapping says; the defaults are what a tidy table says by its columns' names.

    format : of the mapping; empty without one. kind, order, rotates, axes, angle_unit : of its orientation;
    `device` where a tracker's protocol says all of it. position_axes : what of the file was taken for x, y
    and z.
    """

    format: str = ""
    position_unit: str = "mm"
    kind: str = "quaternion"
    order: str = "wxyz"
    rotates: str = SENSES[0]
    axes: str = ""
    angle_unit: str = ""
    time_unit: str = ""
    rate_hz: float = 0.0
    position_axes: tuple[str, ...] = ("x", "y", "z")

    @property
    def unmapped(self) -> Values:
        """The value that tells a finding's sentence that there is no mapping to write a cure into."""
        return {} if self.format else {"unmapped": True}

    @classmethod
    def of(cls, mapping: Mapping[str, Any] | None, kind: str = "") -> Declared:
        """Take it from a mapping's own keys, or None; kind : of orientations, where the file says it."""
        if mapping is None:
            return cls(kind=kind or cls.kind)
        orientation = mapping.get("orientation") or {}
        usual = "quaternion" if mapping["format"] in ("csv", "xdf") else "matrix"
        kind = kind or orientation.get("kind", usual)
        return cls(
            mapping["format"],
            mapping.get("position_unit", cls.position_unit),
            kind,
            orientation.get("order", cls.order),
            orientation.get("rotates", cls.rotates),
            orientation.get("axes", "") if kind == "euler" else "",
            orientation.get("unit", ""),
            mapping.get("csv", {}).get("time_unit", ""),
            mapping.get("rate_hz", 0.0),
            tuple(mapping.get("position_axes", cls.position_axes)),
        )


TIDY = Declared()
"""A tidy table: millimetres, and quaternions w, x, y, z from the receiver to the transmitter."""
