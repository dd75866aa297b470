"""Hold all that the coach must know beside the archive: whose hand, the layout, what the study asks.

It stands in the archive as a mark, so that the archive alone gives the same advice again.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from shukotsu.anatomy.average_hand import DIGITS
from shukotsu.anatomy.known_digits import known_digits
from shukotsu.errors import InputError
from shukotsu.schemas.config_files import check_config
from shukotsu.schemas.layout import Layout, layout_from_config
from shukotsu.schemas.model import HandFitting, SkeletonModel, model_from_config
from shukotsu.stages.fit_hand.measurements import measurable

METACARPALS = 4
"""Of the fingers, which carry no receiver."""

KIND, LEFT_OUT = "coach", "left-out"
"""Kinds of marks: what holds it in the archive; and a tick at which a busy machine made no estimate."""


@dataclass(frozen=True)
class CoachSetup:
    """Whose hand is calibrated, and how.

    layout, model : content of the study's files, the model one that fits the whole hand. measurements : rows
    of the study's sheet (quantity, value_mm, sd_mm) of this hand. points : by name x, y, z in the
    transmitter's frame and the sd, mm. calliper : whether one is at hand.
    """

    study: str
    subject: str
    hand: str
    session: str
    task: str
    layout: Mapping[str, Any]
    wanted_mm: float
    model: Mapping[str, Any]
    trial: str = ""
    hand_length_mm: float | None = None
    hand_breadth_mm: float | None = None
    measurements: tuple[Mapping[str, Any], ...] = ()
    points: Mapping[str, tuple[float, float, float, float]] = field(default_factory=dict)
    calliper: bool = False

    @property
    def whose(self) -> dict[str, str]:
        """Cells of a sheet's row that say whose it is."""
        return {"subject": self.subject, "hand": self.hand, "session": self.session}

    def to_json(self) -> str:
        """Give it as the text of a JSON object: in an archive's event the order of a layout's segments would
        be lost.
        """
        return json.dumps(asdict(self), ensure_ascii=False)

    def skeleton_model(self) -> SkeletonModel:
        """Give the model; raise InputError where it fits no whole hand."""
        return model_from_config(dict(self.model), "the coach's model")

    @property
    def fitting(self) -> HandFitting:
        """How the model fits the whole hand; raise InputError where it does not."""
        fitting = self.skeleton_model().fitting
        if fitting is None:
            raise InputError(
                f"model {self.model['model']} fits no whole hand; the coach needs one that does (whole-hand)"
            )
        return fitting

    def layout_of_hand(self) -> Layout:
        """Give the layout, as the study's plan has it."""
        return layout_from_config(dict(self.layout), "the coach's layout").of_hand(self.hand)


def setup_from_json(text: Any, where: str) -> CoachSetup:
    """Read what `to_json` gave; raise InputError where it is none."""
    names = CoachSetup.__dataclass_fields__
    try:
        content = json.loads(text)
        known = {name: content[name] for name in names}
        for name in ("study", "subject", "session", "task", "trial"):
            known[name] = str(known[name])
        for name, kind in (("layout", "layout"), ("model", "model")):
            known[name] = check_config(known[name], kind, where)
        known["hand"] = {"right": "right", "left": "left"}[known["hand"]]
        known["wanted_mm"] = float(known["wanted_mm"])
        for name in ("hand_length_mm", "hand_breadth_mm"):
            known[name] = None if known[name] is None else float(known[name])
        known["measurements"] = tuple(
            {"quantity": str(row["quantity"]), **{name: float(row[name]) for name in ("value_mm", "sd_mm")}}
            for row in known["measurements"]
        )
        known["points"] = {name: tuple(map(float, own)) for name, own in known["points"].items()}
        return checked_setup(CoachSetup(**known))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{where}: what the coach was set up with cannot be read; name the study with --study"
        ) from error


def checked_setup(setup: CoachSetup) -> CoachSetup:
    """Give the setup; raise InputError where its layout or its model is none that can be coached."""
    layout = setup.layout_of_hand()
    _ = setup.fitting
    digits = known_digits(layout)
    bones = {segment for digit in digits for segment in digit.segments}
    worn = {segment for segment in bones if layout.segments[segment].measured}
    whole = (
        len(digits) == len(DIGITS) and len(worn) == len(bones) - METACARPALS and worn <= {*layout.expected}
    )
    if not whole:
        raise InputError(
            f"layout {layout.name}: has not a receiver on every bone of all five digits, as the coach needs; "
            "expected one such as liberty16, or record with `shukotsu record`"
        )
    return setup


def names_of(layout: Layout, points: Collection[str]) -> dict[str, list[str]]:
    """Give what may be entered: digits, known points, and quantities that can be measured."""
    digits = [digit.name for digit in known_digits(layout)]
    return {"digits": digits, "points": list(points), "quantities": measurable(layout)}


def check_names(entry: Mapping[str, Any], layout: Layout, setup: CoachSetup) -> None:
    """Raise InputError where an entry names a digit, a part, a point or a quantity that there is not, or a
    quantity that the study has already.
    """
    known = names_of(layout, setup.points) | {"parts": ["tip", "pad"]}
    places = {
        "digit": "digits",
        "meets": "digits",
        "point": "points",
        "quantity": "quantities",
        "part": "parts",
    }
    for name in places.keys() & entry.keys():
        among = known[places[name]]
        if entry[name] not in among:
            expected = ", ".join(among) or "none"
            raise InputError(f"{name}: {entry[name]!r} is not known; expected one of {expected}")
    quantity = entry.get("quantity", "")
    if quantity and entry["value_mm"] <= 0 and "." not in quantity:
        raise InputError(f"{quantity}: is {entry['value_mm']:g} mm; expected a length above 0")
    for row in setup.measurements:
        if row["quantity"] == quantity:
            in_sheet = f"{row['value_mm']:g} mm"
            raise InputError(f"{quantity}: is {in_sheet} in the sheet of measurements; change it there")
    if "meets" in entry and entry["meets"] == entry["digit"]:
        raise InputError(f"meets: {entry['digit']!r} cannot meet itself; expected two digits")
