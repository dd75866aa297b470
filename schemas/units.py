"""Units of positions: what programs call them, and how long they are."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres of every unit that a position may come in."""

UNIT_NAMES = {
    **{unit: unit for unit in MM_PER_UNIT},
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("in", "inches"), "inch"),
}
"""What programs write of a unit, in lower case, and the mapping's name for it."""
