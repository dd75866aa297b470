"""Comparing a subject's recordings: another person, receivers put on again, the same file named twice."""

import re
from dataclasses import replace

import pytest
from simulated_poses import hand_of

from benchmarks.faultless_hands import Planted
from shukotsu.checks.checked_recording import CheckedRecording, check_recording
from shukotsu.checks.checked_subject import compare_recordings
from shukotsu.study.findings import NOTE, SUSPECT
from shukotsu.study.layout import read_layout

Named = tuple[str, str, CheckedRecording]
"""Task, hand and checked recording."""


def checked(planted: Planted) -> CheckedRecording:
    return check_recording(planted.poses, read_layout("liberty16"), planted.hand)


@pytest.fixture(scope="module")
def person() -> list[Named]:
    tasks = (("right", "rom"), ("right", "opposition"), ("left", "rom"))
    return [(task, hand, checked(hand_of(11, hand, task))) for hand, task in tasks]


@pytest.fixture(scope="module")
def other() -> Named:
    return "grip", "right", checked(hand_of(12, task="opposition"))


def kinds(recordings: list[Named]) -> list[list[tuple[str, str]]]:
    return [[(each.kind, each.severity) for each in c.findings] for c in compare_recordings(recordings)]


def test_recordings_of_one_person_have_no_finding(person: list[Named]) -> None:
    assert kinds(person) == [[], [], []]


def test_the_recording_of_another_person_is_suspected(person: list[Named], other: Named) -> None:
    assert kinds([*person, other])[3] == [("other-person", SUSPECT)]
    assert kinds([other, *person])[:3] == [[("other-person", SUSPECT)], [], []]
    sentence = compare_recordings([*person, other])[3].findings[0].message
    assert "another recording (right hand, rom" in sentence
    assert "another person" in sentence
    assert re.search("correct the column subject(?: or file)? of the recordings sheet", sentence)
    assert kinds([other]) == [[]], "a recording is not compared with itself"


def test_a_recording_with_a_sudden_change_is_not_compared_with_others(
    person: list[Named], other: Named
) -> None:
    poses, layout = hand_of(11).poses, read_layout("liberty16")
    seen = {"segments": ["hand"], "until": False, "grown": 5.0, "percent": 50.0, "first_s": 2.0}
    broken = check_recording(poses, layout, "right", breaks=[seen])
    assert kinds([("rom", "right", broken), other])[1] == []
    assert kinds([("rom", "right", broken), person[1]]) == [[("sudden-change", SUSPECT)], []]
    few = check_recording(poses, layout, "right", breaks=[seen | {"percent": 9.0}])
    assert few.findings[0].severity == SUSPECT
    assert "receiver hand contradicts its neighbours, first at 2.00 s" in few.findings[0].message


def test_receivers_put_on_again_are_a_note() -> None:
    """A person's other hand, mirrored, stands in for them: it has the same lengths but other receiver
    positions.
    """
    first, later = (("rom", "right", checked(hand_of(7, hand))) for hand in ("right", "left"))
    before, (finding,) = (recording.findings for recording in compare_recordings([first, later]))
    assert (before, finding.kind, finding.severity) == ((), "other-person", NOTE)
    assert "give this recording a separate session in the column session" in finding.message
    assert kinds([later]) == [[]], "a recording is not compared with itself"


def test_a_copied_recording_is_suspected(person: list[Named]) -> None:
    again = ("copy", "right", person[0][2])
    (finding,) = compare_recordings([*person, again])[3].findings
    assert (finding.kind, finding.severity) == ("same-file", SUSPECT)
    sentence = finding.message
    assert re.search("those of (the )?right hand('s|,) rom", sentence)
    assert re.search(r"correct the column (\w+ or )?file", sentence)
    assert "give a reason under `exclude`" in sentence


def test_a_copy_named_as_the_other_hand_is_suspected_alone(person: list[Named]) -> None:
    copied, right = kinds([("rom", "left", checked(replace(hand_of(11), hand="left"))), person[0]])
    assert copied == [("same-file", SUSPECT), ("wrong-hand", SUSPECT)]
    assert right == []
