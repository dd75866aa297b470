"""Findings: kinds that users rely on, their sentences, what accepting does, and what of them is one item."""

from __future__ import annotations

import re
from typing import Any

import pytest
from finding_examples import EVIDENCE, EXAMPLES, examples

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
        "unchecked"
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
