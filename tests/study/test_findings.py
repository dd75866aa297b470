"""Findings: their kinds, sentences, acceptance, and grouping into items."""

import re
from dataclasses import replace
from typing import Any

import pytest

from shukotsu.resources import ROOT
from shukotsu.study import findings
from shukotsu.study.config_files import read_yaml
from shukotsu.study.findings import (
    MISTAKES,
    NOTE,
    PROBLEMS,
    REFUSED,
    STAGE,
    SUSPECT,
    Finding,
    Seen,
    faults,
    finding_of,
    problem_row,
    row_sentence,
)

VALUES: dict[str, Any] = {
    "segment": "index_middle", "segment_2": "index_distal", "segments": ["index_distal", "hand"],
    "joints": ["index_mcp", "middle_mcp"], "digit": "thumb", "digit_2": "index",
    "pairs": [["thumb_proximal", "index_middle"], ["thumb_distal", "index_distal"]],
    "subject": "", "session": "", "hand": "left", "hand_2": "right", "task": "rom", "recording": "rom",
    "count": 43, "of": ["hand", "index_distal"], "counts": [40, 3], "percent": 12.0, "frames": 12,
    "first_s": 3.25, "number": 7, "number_2": 90, "others": 3,
    "from_s": 7.9, "to_s": 9.9, "by_s": 2.0, "by": "2", "rows": 1, "steps": 1, "until": False,
    "read": "mm", "true": "cm", "order": "xyzw", "anew": "qx, qy, qz, qw", "factor": 10.0,
    "rotates": "receiver-to-transmitter", "columns": "z, -y, -x", "negated": ["x", "z"],
    "rate_hz": 0.24, "true_hz": 240.0, "unit": "ms", "speed_rad_s": 171.0, "grown": 25.4,
    "turn_deg": -90, "turn_axis": "y", "distal": [0, 1, 0], "lateral": [-1, 0, 0], "dorsal": [0, 0, 1],
    "x": 220.0, "y": -80.0, "z": -50.0, "mm": 4.2, "deg": 12.0, "scale": 0.92, "usual": 1.03,
    "spiked": [["hand", 780, 3.25], ["index_distal", 12]], "groups": "[A, B, C]",
    "reason": "internal error in check_recordings (KeyError: 1)",
}  # fmt: skip
"""A value for every placeholder of the sentences."""

FORMS: tuple[dict[str, Any], ...] = (
    {},
    {"count": 1, "of": ["hand"], "counts": [1], "others": 1, "segments": ["hand"], "negated": ["z"]},
    {"others": 0, "unmapped": True, "duration_s": 0.2, "turn_axis": "", "subject": "01"},
    {"subject": "01", "session": "late", "cure": "reader_cure"},
    {"cure": "new_mapping_cure"},
)
"""Values that change the sentences: singular and plural, with and without a mapping or another person."""

EVIDENCE: dict[str, dict[str, Any]] = {
    "scale": {"before": 0.01, "after": 0.98},
    "reach": {"before": 0.09, "after": 92.0},
    "gap": {"joint": "index_pip", "before": 31.2, "after": 1.4},
    "place": {"joint": "index_dip", "before": 41.0, "after": 3.0},
    "turn": {"joint": "thumb_cmc", "angle": "axial rotation", "least": -125.0, "most": -100.0,
             "least_after": -35.0, "most_after": -10.0},
}  # fmt: skip

EFFECT = {"gap_before_mm": 12.13, "gap_after_mm": 1.31, "moved": 5, "joints": 16, "effect": "closer"}

KINDS = read_yaml(ROOT / "schemas" / "mistakes.yaml", "mistakes")


def finding_of_key(key: str, **values: Any) -> Finding:
    kind, _, variant = key.partition("/")
    return Finding(kind, SUSPECT, variant, VALUES | values)


def examples() -> list[Finding]:
    """Return every kind and variant in each of its forms, and a finding with each kind of evidence."""
    every = [finding_of_key(key, **form) for key in (*MISTAKES, *PROBLEMS) for form in FORMS]
    in_row = {name: value for name, value in VALUES.items() if name != "first_s"} | {"first_row": 12}
    every += [
        replace(finding, values=in_row) for finding in every if "{at}" in str(MISTAKES.get(finding.key))
    ]
    swapped = [finding_of_key("receivers-swapped", seen=seen, **values) for seen, values in EVIDENCE.items()]
    every.append(Finding("receiver", SUSPECT, "", {"segment": "hand", "text": "no valid pose of hand"}))
    put_right = finding_of_key("hemisphere/jumps", **EFFECT)
    gap = finding_of_key("receivers-swapped", seen="gap", **EVIDENCE["gap"], **EFFECT)
    return [*every, *swapped, put_right, gap]


def rows(finding: Finding, count: int) -> list[dict[str, Any]]:
    return [problem_row(STAGE, finding, subject=f"S{i}", hand="right", task="rom") for i in range(count)]


def units(scale: float) -> Finding:
    return finding_of_key("units/positions-small", seen="scale", before=scale, after=1.0)


def test_one_fault_in_eleven_recordings_is_one_item() -> None:
    each = [rows(units(0.1 + i / 100), 1)[0] | {"subject": f"S{i}"} for i in range(11)]
    (fault,) = faults(each)
    assert fault.text == (
        "The positions seem to be in cm but are read as mm, which differs by a factor of 10; write "
        "`position_unit: cm` in the mapping."
    )
    assert [seen.row["subject"] for seen in fault.seen] == [f"S{i}" for i in range(11)]
    assert not any(seen.what for seen in fault.seen)
    assert fault.seen[3].evidence == "the hand has 0.13 times the average size, after correction 1 times"


def test_a_fault_of_one_recording_is_its_findings_sentence() -> None:
    for finding in examples():
        (fault,) = faults(rows(finding, 1))
        assert fault.text == finding.message == row_sentence(rows(finding, 1)[0])
        assert fault.seen == (Seen(rows(finding, 1)[0]),)


def test_findings_with_different_cures_or_severities_are_separate_items() -> None:
    different = [
        units(0.1),
        finding_of_key("units/positions-small", true="inch"),
        Finding("units", SUSPECT, "radians"),
        Finding("units", REFUSED, "radians"),
        units(0.1).accept("a doll"),
        units(0.1).accept("another doll"),
    ]
    every = [row for finding in different for row in rows(finding, 2)]
    assert [len(fault.seen) for fault in faults(every)] == [2] * 6


def test_evidence_is_listed_with_each_recording() -> None:
    (fault,) = faults(rows(finding_of_key("receivers-swapped", seen="gap", **EVIDENCE["gap"]), 2))
    assert "gap" not in fault.text
    assert {seen.evidence for seen in fault.seen} == {
        "after correction, the gap of index_pip falls from 31.2 to 1.4 mm"
    }


def test_the_kinds_are_those_documented_for_users() -> None:
    expected = (
        "quaternion-order, quaternion-inverse, euler-order, units, time-unit, clock, hemisphere, "
        "receiver-stuck, sudden-change, spikes, receivers-swapped, digits-swapped, wrong-hand, "
        "axes-mirrored, receiver-turned, other-person, same-file, too-short, zeros, receivers-alike, "
        "cluster-not-rigid, receivers-absent, unchecked"
    )
    assert ", ".join(KINDS) == expected


def test_accepting_makes_a_suspect_finding_a_note_with_the_reason() -> None:
    accepted = Finding("units", SUSPECT, "radians").accept("a child of two")
    assert accepted == Finding("units", NOTE, "radians", accepted="a child of two")
    assert accepted.message == f"{Finding('units', SUSPECT, 'radians').message} Accepted: a child of two"
    for severity in (REFUSED, NOTE):
        assert Finding("units", severity, "radians").accept("why").severity == severity
    assert Finding("units", SUSPECT, "radians").accept("").severity == SUSPECT


def test_the_examples_cover_every_kind_and_variant() -> None:
    assert {key.partition("/")[0] for key in MISTAKES} == {*KINDS}
    assert {*findings.EVIDENCE} == {*EVIDENCE}


@pytest.mark.parametrize("finding", examples(), ids=lambda each: f"{each.kind}-{each.variant}")
def test_findings_have_complete_sentences_and_survive_a_round_trip(finding: Finding) -> None:
    message = finding.message
    assert not message[0].islower() or finding.kind not in KINDS
    assert not re.search(r"  |\{\w*\}|None|\[\]|: :|,,", message)
    assert finding_of(finding.columns) == finding
    assert finding.columns["message"] == message


def test_a_sentence_has_the_mistake_its_effect_and_the_cure() -> None:
    swapped = examples()[-1]
    assert swapped.what == ("The receivers index_middle and index_distal seem to be swapped")
    assert swapped.message == (
        "The receivers index_middle and index_distal seem to be swapped (after correction, the gap of "
        "index_pip falls from 31.2 to 1.4 mm; after correction, the median gap of the joints concerned goes "
        "from 12.1 to 1.3 mm, and 5 of 16 centres move by more than 2 mm); exchange these names under "
        "`receivers` in the mapping: index_middle with index_distal."
    )
    turned = finding_of_key("receiver-turned/one")
    assert "by -90 deg about its y axis" in turned.message
    axes = "`receiver_axes: {distal: [0, 1, 0], lateral: [-1, 0, 0], dorsal: [0, 0, 1]}`"
    assert f"write {axes} under the segment index_middle in the layout" in turned.message
