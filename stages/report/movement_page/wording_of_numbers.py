"""What the movement page calls joints, quantities, places and numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from shukotsu.sentences.translation import N_, ngettext, tr, word
from shukotsu.stages.report.table_cells import number

if TYPE_CHECKING:
    pass

QUANTITIES = {
    "range_deg": N_("range of motion"),
    "full_range_deg": N_("full range"),
    "median_deg": N_("posture (median angle)"),
    "speed_median_deg_s": N_("median speed"),
    "speed_p95_deg_s": N_("speed (95th percentile)"),
    "path_length_mm": N_("path length"),
    "speed_median_mm_s": N_("median speed"),
    "speed_p95_mm_s": N_("speed (95th percentile)"),
    "sparc": N_("smoothness (SPARC)"),
    "min_mm": N_("least distance"),
    "median_mm": N_("median distance"),
    "contact_percent": N_("time in contact"),
    "n_contacts": N_("number of contacts"),
    "event_measure": N_("strokes"),
}
"""What quantities are called in a sentence; others by their names."""


def angle_text(joint: str, angle: str) -> str:
    """A joint's angle in words: index MCP flexion."""
    digit, _, kind = joint.rpartition("_")
    return tr("{joint} {angle}", joint=f"{digit} {kind.upper()}" if digit else joint, angle=angle)


def of_text(of: str) -> str:
    """The same of a column `of`; digits as they are."""
    joint, _, angle = of.partition(" ")
    if angle and "_" not in joint:  # a digit and what is measured of its strokes
        return f"{word(joint)} {angle.replace('_', ' ')}"
    return angle_text(joint, angle) if angle else "-".join(map(word, of.split("-")))


def place_text(place: tuple[str, str]) -> str:
    """Hand and task in words."""
    hand, task = place
    if not hand or not task:  # what is compared is no place
        return tr("{hand} hand", hand=hand) if hand else task
    return tr("{hand} hand, {task}", hand=hand, task=task)


def quantity_text(quantity: str, of: str) -> str:
    """What is compared, of whom: range of motion, index PIP flexion."""
    name = tr(QUANTITIES[quantity]) if quantity in QUANTITIES else quantity
    return tr("{quantity}, {of}", quantity=name, of=of_text(of))


def amount(value: float, scale: float, unit: str) -> str:
    """A number with its unit, to a hundredth of what is about as large as `scale`."""
    return f"{_digits(value, scale)} {unit}".strip()


def _digits(value: float, scale: float) -> str:
    decimals = 1 - math.floor(math.log10(scale / 3)) if math.isfinite(scale) and scale > 1e-6 else 1
    return number(value, min(max(decimals, 0), 6))


def who_text(row: Any) -> str:
    """How many subjects a number is of."""
    n, n_other = int(row["n"]), int(row["n_other"])
    if row["design"] in ("between", "between;within", "within;between", "between;between") and n_other:
        return tr("{n} and {n_other} subjects", n=n, n_other=n_other)
    return ngettext("{n} subject", "{n} subjects", n)
