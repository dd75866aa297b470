"""Every finding has a sentence in which all its values stand, and none is left open."""

import re

import pytest
from finding_examples import EFFECTS, EVIDENCE, EXAMPLES, examples

from shukotsu.schemas.findings import KINDS, SUSPECT, Finding, values_of
from shukotsu.sentences import finding_sentences
from shukotsu.sentences.finding_sentences import CURES, TABLE_CURES, WHAT, cure_of, key_of, what_of


def test_every_kind_and_variant_is_here() -> None:
    keys = {key_of(*one) for one in EXAMPLES}
    assert WHAT.keys() == CURES.keys() == keys & WHAT.keys()
    assert TABLE_CURES.keys() < WHAT.keys()
    assert {key.partition("/")[0] for key in WHAT} == {*KINDS}
    assert {*finding_sentences.EVIDENCE} == {*EVIDENCE}
    assert {*finding_sentences.EFFECTS} == {*EFFECTS}


@pytest.mark.parametrize("finding", examples(), ids=lambda own: f"{own.kind}-{own.variant}")
def test_a_sentence_is_whole(finding: Finding) -> None:
    message = finding.message
    assert not message[0].islower() or finding.kind not in KINDS
    assert not re.search(r"  |\{\w*\}|None|\[\]|: :|,,", message)
    columns = finding.columns
    again = Finding(columns["kind"], SUSPECT, columns["variant"], values_of(columns["values"]))
    assert again == finding
    assert again.message == columns["message"] == message


def test_what_and_cure_make_the_sentence() -> None:
    swapped = Finding("receivers-swapped", SUSPECT, values=EXAMPLES["receivers-swapped", ""][0])
    what, cure = (part(swapped.kind, swapped.variant, swapped.values) for part in (what_of, cure_of))
    assert swapped.message == f"{what}; {cure}."
    assert what == "The receivers index_middle and index_distal seem to be swapped"


def test_a_sentence_says_how_much_it_matters() -> None:
    swapped = examples()[-1]
    assert swapped.message == (
        "The receivers index_middle and index_distal seem to be swapped: put right, the gap of index_pip "
        "falls from 31.2 to 1.4 mm (the median gap of the joints concerned falls from 12.1 to 1.3 mm, "
        "centres that move by more than 2 mm: 5 of 16); exchange their names in `receivers` of the mapping."
    )


def test_one_is_not_called_several() -> None:
    one, many = (
        Finding("hemisphere", SUSPECT, "left-out", own) for own in EXAMPLES["hemisphere", "left-out"]
    )
    assert one.message.startswith("One pose, of hand, is on the other side")
    assert many.message.startswith("43 poses (40 of hand, 3 of index_distal) are on the other side")


def test_what_is_to_be_written_is_what_files_have() -> None:
    turned = Finding("receiver-turned", SUSPECT, "one", EXAMPLES["receiver-turned", "one"][0])
    assert "by -90 deg about its y axis" in turned.message
    written = "`receiver_axes: {distal: [0, 1, 0], lateral: [-1, 0, 0], dorsal: [0, 0, 1]}`"
    assert f"write {written} under the segment hand in the layout" in turned.message
