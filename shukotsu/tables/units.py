"""Units of positions and times: what programs call them, and how long they are."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres of every unit that a position may come in."""

SECONDS_PER_UNIT = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds of every unit that times may come in."""

UNIT_NAMES = {
    **{unit: unit for unit in MM_PER_UNIT},
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inches"), "inch"),
}
"""What programs write of a unit, in lower case, and the mapping's name for it."""
