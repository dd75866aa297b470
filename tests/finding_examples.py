"""One finding of every kind and variant, with values as the checks and the stages give them."""

from __future__ import annotations

from typing import Any

from shukotsu.study.findings import SUSPECT, Finding

AT = {"first_s": 3.25}
PAIR = {"segment": "index_middle", "segment_2": "index_distal"}
PAIRS = [["thumb_proximal", "index_middle"], ["thumb_distal", "index_distal"]]
BREAK = {"number": 7, "from_s": 7.9, "to_s": 9.9, "by_s": 2.0, "by": "2", "rows": 1, "steps": 1}
OTHER_HAND = {"hand": "left", "hand_2": "right"}
CLOCK = {"rate_hz": 0.24, "unit": "ms", "read": "seconds", "factor": 0.001}
TURNED = {"turn_deg": -90, "turn_axis": "y", "distal": [0, 1, 0], "lateral": [-1, 0, 0], "dorsal": [0, 0, 1]}
OTHER = {"subject": "", "session": "", "hand": "right", "task": "rom"}
COUNTED = {"count": 43, "of": ["hand", "index_distal"], "counts": [40, 3]}
ONE = {"count": 1, "of": ["hand"], "counts": [1]}
READ_AS = {"read": "mm", "true": "cm"}

EVIDENCE: dict[str, dict[str, Any]] = {
    "scale": {"before": 0.01, "after": 0.98},
    "reach": {"before": 0.09, "after": 92.0},
    "gap": {"joint": "index_pip", "before": 31.2, "after": 1.4},
    "place": {"joint": "index_dip", "before": 41.0, "after": 3.0},
    "turn": {"joint": "thumb_cmc", "angle": "axial rotation", "least": -125.0, "most": -100.0,
             "least_after": -35.0, "most_after": -10.0},
}  # fmt: skip

GAPS = {"gap_before_mm": 12.13, "gap_after_mm": 1.31, "moved": 5, "joints": 16}
EFFECT = {**GAPS, "effect": "closer"}

BROKEN = {"segments": ["hand"], "segment": "hand", "until": False, "grown": 25.4, "percent": 48.0}

EXAMPLES: dict[tuple[str, str], list[dict[str, Any]]] = {
    ("quaternion-order", "order"): [{"read": "w, x, y, z", "true": "x, y, z, w", "order": "xyzw"}],
    ("quaternion-order", "inverse-too"): [
        {"true": "x, y, z, w", "order": "xyzw", "rotates": "transmitter-to-receiver"}
    ],
    ("quaternion-inverse", ""): [{"rotates": "receiver-to-transmitter"}, {"unmapped": True}],
    ("euler-order", "axes"): [{"read": "ZYX", "true": "XYZ"}],
    ("euler-order", "fixed"): [{"read": "ZYX", "true": "XYZ"}],
    ("units", "positions-small"): [{"factor": 10.0, **READ_AS}],
    ("units", "positions-large"): [{"factor": 10.0, **READ_AS}],
    ("units", "radians"): [{}],
    ("units", "degrees"): [{"speed_rad_s": 171.0}],
    ("time-unit", ""): [CLOCK, CLOCK | {"unmapped": True}],
    ("time-unit", "scaled"): [CLOCK],
    ("time-unit", "rate"): [{"rate_hz": 0.24, "true_hz": 240.0}],
    **{("clock", own): [BREAK] for own in ("ahead", "back", "midnight", "wrap", "still")},
    ("hemisphere", "jumps"): [
        {"segment": "hand", "count": 2, "others": 3, **AT},
        {"segment": "hand", "count": 1, "others": 1, "first_row": 12},
        {"segment": "hand", "count": 1, "others": 0, **AT},
    ],
    ("hemisphere", "all-along"): [
        {"segments": ["hand"], "count": 1},
        {"segments": ["hand", "index_distal"], "count": 2},
    ],
    ("hemisphere", "whole"): [{}],
    ("hemisphere", "left-out"): [ONE, COUNTED],
    ("hemisphere", "between"): [COUNTED],
    ("hemisphere", "put-back"): [COUNTED],
    ("hemisphere", "undecided"): [COUNTED],
    ("receiver-stuck", "repeated"): [{"percent": 50.0}],
    ("receiver-stuck", "at-times"): [{"segment": "hand", "percent": 3.4, **AT}],
    ("receiver-stuck", "all-along"): [{"segment": "hand"}],
    ("sudden-change", "one"): [BROKEN | AT],
    ("sudden-change", "until"): [BROKEN | AT],
    ("sudden-change", "all"): [BROKEN | {"first_row": 12}],
    ("spikes", "some"): [
        {"segment": "hand", "count": 1, "spiked": [["hand", 780, 3.25]], **AT},
        {"segment": "hand", "count": 9, "spiked": [["hand", 780], ["index_distal", 12]], **AT},
    ],
    ("spikes", "left-out"): [ONE, COUNTED],
    ("spikes", "all"): [{}, {"unmapped": True}],
    ("unchecked", ""): [{"reason": "internal error in check_recordings (KeyError: 1)"}],
    ("knuckles-too-close", ""): [{"joints": ["middle_mcp", "ring_mcp"], "mm": 4.5}],
    ("receiver-loose", ""): [{"segment": "hand", "message": "came loose"}],
    ("receiver-slid", ""): [{"segment": "hand", "message": "slid"}],
    ("receiver-moved", ""): [{"segment": "hand", "message": "sits elsewhere"}],
    ("field-disturbed", ""): [
        {"x": 220.0, "y": -80.0, "z": -50.0, "count": 2, "mm": 6.2, "deg": 3.0, "percent": 4.0,
         "segments": ["index_distal", "index_middle"]}
    ],
    ("receivers-swapped", ""): [PAIR, PAIR | {"unmapped": True}],
    ("digits-swapped", "two"): [
        {"digit": "thumb", "digit_2": "index", "pairs": PAIRS},
        {"digit": "thumb", "digit_2": "index", "pairs": PAIRS, "unmapped": True},
    ],
    ("digits-swapped", "reversed"): [{"pairs": PAIRS}],
    ("wrong-hand", ""): [OTHER_HAND, OTHER_HAND | {"unmapped": True}],
    ("axes-mirrored", "negated"): [
        {"negated": ["z"], "count": 1, "columns": "x, y, -z"},
        {"negated": ["x", "y", "z"], "count": 3, "columns": "-x, -y, -z"},
    ],
    ("axes-mirrored", "exchanged"): [{"columns": "z, -y, -x"}, {"columns": "z, -y, -x", "unmapped": True}],
    ("receiver-turned", "all"): [TURNED, TURNED | {"turn_deg": 120, "turn_axis": ""}],
    ("receiver-turned", "one"): [TURNED | {"segment": "hand"}],
    ("other-person", "another"): [OTHER | {"scale": 0.92, "usual": 1.03}],
    ("other-person", "put-on-anew"): [OTHER],
    ("same-file", ""): [OTHER, OTHER | {"subject": "01"}, OTHER | {"subject": "01", "session": "late"}],
    ("too-short", ""): [{"frames": 12}, {"frames": 12, "duration_s": 0.2}],
    ("zeros", ""): [{"segment": "hand", "count": 1, **AT}, {"segment": "hand", "count": 200, **AT}],
    ("receivers-alike", ""): [PAIR | {"percent": 100.0, **AT}],
    ("recording", "no-pose"): [{"segments": ["index_distal", "hand"]}],
    ("hand", "uncalibrated"): [{}],
    ("receiver", ""): [{"segment": "hand", "text": "no valid pose of hand; check that receiver"}],
}  # fmt: skip
"""By kind and variant: values, where its sentence has several forms those of each."""


def examples() -> list[Finding]:
    """Every kind and variant in each of its forms, and one with each kind of evidence."""
    every = [
        Finding(kind, SUSPECT, variant, values)
        for (kind, variant), several in EXAMPLES.items()
        for values in several
    ]
    swapped = [
        Finding("receivers-swapped", SUSPECT, values={**PAIR, "seen": seen, **values})
        for seen, values in EVIDENCE.items()
    ]
    put_right = Finding("hemisphere", SUSPECT, "jumps", EXAMPLES["hemisphere", "jumps"][0] | EFFECT)
    return [*every, *swapped, put_right, Finding("receivers-swapped", SUSPECT, "", _SWAPPED)]


_SWAPPED = {**PAIR, "seen": "gap", **EVIDENCE["gap"], **EFFECT}
