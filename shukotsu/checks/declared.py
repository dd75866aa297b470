"""Hold what was declared of a recording's numbers: its mapping's units, orders and senses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from shukotsu.sentences.finding_sentences import Values


@dataclass(frozen=True)
class Declared:
    """Hold what a mapping says; the defaults are what a tidy table says by its columns' names.

    format : of the mapping; empty without one. kind, order, rotates, axes, angle_unit : of its orientation;
    the kind is `device` where a tracker's own protocol says all of it.
    time_unit, rate_hz : empty and 0 where it says nothing of them. position_axes : what of the file's
    positions was taken for x, y and z.
    """

    format: str = ""
    position_unit: str = "mm"
    kind: str = "quaternion"
    order: str = "wxyz"
    rotates: str = "receiver-to-transmitter"
    axes: str = ""
    angle_unit: str = ""
    time_unit: str = ""
    rate_hz: float = 0.0
    position_axes: tuple[str, ...] = ("x", "y", "z")

    @property
    def has_orientations(self) -> bool:
        """Say whether the file has orientations, which could be inverse: clusters of markers have none."""
        return self.format != "c3d"

    @property
    def is_inverted(self) -> bool:
        """Say whether the file's rotations were inverted as they were read."""
        return self.rotates == "transmitter-to-receiver"

    @property
    def unmapped(self) -> Values:
        """Return the value that tells a finding's sentence that there is no mapping to write a cure into."""
        return {} if self.format else {"unmapped": True}

    @property
    def other_sense(self) -> str:
        """The sense of the rotations that was not declared."""
        senses = ("receiver-to-transmitter", "transmitter-to-receiver")
        return senses[self.rotates == senses[0]]

    @classmethod
    def of(cls, mapping: Mapping[str, Any] | None, kind: str = "") -> Declared:
        """Take it from the mapping's own keys; None where there is no mapping.

        kind : of the orientations, where the file itself says it.
        """
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
"""Of a tidy table: millimetres, and quaternions w, x, y, z from the receiver to the transmitter."""
