"""Findings: kinds that users rely on, their sentences, what accepting does, and what of them is one item."""

from __future__ import annotations

import re
from typing import Any

import pytest

from shukotsu.study import findings
from shukotsu.study.findings import (
    MISTAKES,
    NOTE,
    REFUSED,
    STAGE,
    SUSPECT,
    Finding,
    Seen,
    faults,
    kinds,
    problem_row,
    row_sentence,
    values_of,
)

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

MOVED = {"segment": "hand", "recording": "rom", "mm": 4.2, "deg": 12.0, "joints": ["index_mcp", "middle_mcp"]}
LOOSE = {"segment": "hand", "percent": 12.0, "groups": "[A, B, C]"}
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
    **{("clock", kind): [BREAK] for kind in ("ahead", "back", "midnight", "wrap", "still")},
    ("clock", "packets"): [{"frames": 4, "rate_hz": 120.0}],
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
    ("receiver-loose", ""): [{"segment": "hand", "text": "came loose"}],
    ("receiver-slid", ""): [{"segment": "hand", "text": "slid"}],
    ("receiver-moved", ""): [MOVED | AT],
    ("receiver-moved", "in-frame"): [MOVED | {"number": 7}],
    ("field-disturbed", ""): [
        {"x": 220.0, "y": -80.0, "z": -50.0, "count": 2, "mm": 6.2, "deg": 3.0, "percent": 4.0,
         "segments": ["index_distal", "index_middle"]}
    ],
    ("receivers-swapped", ""): [PAIR, PAIR | {"unmapped": True}],
    ("receivers-swapped", "in-part"): [PAIR | AT | {"number": 7, "number_2": 90}],
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
    ("cluster-not-rigid", ""): [LOOSE],
    ("cluster-not-rigid", "apart"): [LOOSE],
    ("cluster-not-rigid", "some"): [COUNTED],
    ("receivers-absent", ""): [{"segments": ["index_distal", "hand"]}],
    ("receivers-absent", "unmapped"): [{"segments": ["index_distal", "hand"]}],
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
    swapped_gap = {**PAIR, "seen": "gap", **EVIDENCE["gap"], **EFFECT}
    put_right = Finding("hemisphere", SUSPECT, "jumps", EXAMPLES["hemisphere", "jumps"][0] | EFFECT)
    return [*every, *swapped, put_right, Finding("receivers-swapped", SUSPECT, "", swapped_gap)]


def rows(finding: Finding, count: int) -> list[dict[str, Any]]:
    return [problem_row(STAGE, finding, subject=f"S{i}", hand="right", task="rom") for i in range(count)]


def units(scale: float) -> Finding:
    values = EXAMPLES["units", "positions-small"][0] | {"seen": "scale", "before": scale, "after": 1.0}
    return Finding("units", SUSPECT, "positions-small", values)


def test_one_fault_in_eleven_recordings_is_one_item() -> None:
    each = [rows(units(0.1 + i / 100), 1)[0] | {"subject": f"S{i}"} for i in range(11)]
    (fault,) = faults(each)
    assert fault.text == (
        "The positions seem to be in cm and are read as mm, a factor of 10 off; write `position_unit: cm` in "
        "the mapping."
    )
    assert [seen.row["subject"] for seen in fault.seen] == [f"S{i}" for i in range(11)]
    assert not any(seen.what for seen in fault.seen)
    assert fault.seen[3].evidence == "the hand comes out 0.13 times the average size, put right 1 times"


def test_a_fault_of_one_recording_is_its_sentence() -> None:
    for finding in examples():
        (fault,) = faults(rows(finding, 1))
        assert fault.text == finding.message == row_sentence(rows(finding, 1)[0])
        assert fault.seen == (Seen(rows(finding, 1)[0]),)


def test_another_cure_variant_severity_or_reason_is_another_item() -> None:
    inches = EXAMPLES["units", "positions-small"][0] | {"true": "inch"}
    different = [
        units(0.1),
        Finding("units", SUSPECT, "positions-small", inches),
        Finding("units", SUSPECT, "radians"),
        Finding("units", REFUSED, "radians"),
        units(0.1).accept("a doll"),
        units(0.1).accept("another doll"),
    ]
    every = [row for finding in different for row in rows(finding, 2)]
    assert [len(fault.seen) for fault in faults(every)] == [2] * 6


def test_evidence_stands_where_it_is_seen() -> None:
    values = {**EXAMPLES["receivers-swapped", ""][0], "seen": "gap", **EVIDENCE["gap"]}
    (fault,) = faults(rows(Finding("receivers-swapped", SUSPECT, "", values), 2))
    assert "gap" not in fault.text
    assert {seen.evidence for seen in fault.seen} == {
        "put right, the gap of index_pip falls from 31.2 to 1.4 mm"
    }


def test_kinds_are_those_of_the_contract() -> None:
    expected = (
        "quaternion-order, quaternion-inverse, euler-order, units, time-unit, clock, hemisphere, "
        "receiver-stuck, sudden-change, spikes, receivers-swapped, digits-swapped, wrong-hand, "
        "axes-mirrored, receiver-turned, other-person, same-file, too-short, zeros, receivers-alike, "
        "cluster-not-rigid, receivers-absent, unchecked"
    )
    assert ", ".join(kinds()) == expected


def test_accepting_makes_a_suspect_finding_a_note_with_the_reason() -> None:
    accepted = Finding("units", SUSPECT, "radians").accept("a child of two")
    assert accepted == Finding("units", NOTE, "radians", accepted="a child of two")
    assert accepted.message == f"{Finding('units', SUSPECT, 'radians').message} Accepted: a child of two"
    for severity in (REFUSED, NOTE):
        assert Finding("units", severity, "radians").accept("why").severity == severity
    assert Finding("units", SUSPECT, "radians").accept("").severity == SUSPECT


def test_every_kind_and_variant_is_here() -> None:
    assert MISTAKES.keys() == {"/".join(filter(None, each)) for each in EXAMPLES} & MISTAKES.keys()
    assert {key.partition("/")[0] for key in MISTAKES} == {*kinds()}
    assert {*findings.EVIDENCE} == {*EVIDENCE}


@pytest.mark.parametrize("finding", examples(), ids=lambda each: f"{each.kind}-{each.variant}")
def test_a_sentence_is_whole(finding: Finding) -> None:
    message = finding.message
    assert not message[0].islower() or finding.kind not in kinds()
    assert not re.search(r"  |\{\w*\}|None|\[\]|: :|,,", message)
    columns = finding.columns
    again = Finding(columns["kind"], SUSPECT, columns["variant"], values_of(columns["values"]))
    assert again == finding
    assert again.message == columns["message"] == message


def test_a_sentence_says_what_is_seen_how_much_it_matters_and_what_to_write() -> None:
    swapped = examples()[-1]
    assert swapped.what == ("The receivers index_middle and index_distal seem to be swapped")
    assert swapped.message == (
        "The receivers index_middle and index_distal seem to be swapped (put right, the gap of index_pip "
        "falls from 31.2 to 1.4 mm; put right, the median gap of the joints concerned goes from 12.1 to "
        "1.3 mm, and 5 of 16 centres move by more than 2 mm); exchange these names in `receivers` of the "
        "mapping: index_middle with index_distal."
    )
    turned = Finding("receiver-turned", SUSPECT, "one", EXAMPLES["receiver-turned", "one"][0])
    assert "by -90 deg about its y axis" in turned.message
    axes = "`receiver_axes: {distal: [0, 1, 0], lateral: [-1, 0, 0], dorsal: [0, 0, 1]}`"
    assert f"write {axes} under the segment hand in the layout" in turned.message
