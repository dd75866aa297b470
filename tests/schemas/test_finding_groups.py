"""What is wrong in the same way is one item, with the recordings that have it; what differs is another."""

from __future__ import annotations

from typing import Any

from finding_examples import EVIDENCE, EXAMPLES, examples

from shukotsu.schemas.finding_groups import Seen, faults, row_sentence
from shukotsu.schemas.findings import REFUSED, STAGE, SUSPECT, Finding, problem_row


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


def test_what_differs_is_said_of_each_beside_the_common_cure() -> None:
    seen = EXAMPLES["hemisphere", "jumps"][0]
    jumps = [Finding("hemisphere", SUSPECT, "jumps", {**seen, "segment": segment})
             for segment in ("hand", "index_distal")]  # fmt: skip
    (fault,) = faults(row for finding in jumps for row in rows(finding, 1))
    assert fault.text.startswith("Write `repair` in the column hemisphere")
    assert [seen.what.split(" jumps")[0] for seen in fault.seen] == [
        "The position of hand",
        "The position of index_distal",
    ]
