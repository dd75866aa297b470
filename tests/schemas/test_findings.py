"""Findings: what accepting one does, which hands judge nothing, and the kinds that users rely on."""

from shukotsu.schemas.findings import NOTE, REFUSED, SUSPECT, Finding, kinds


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
