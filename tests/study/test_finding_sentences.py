"""Every finding has a sentence in which all its values stand, and none is left open."""

import re

import pytest
from finding_examples import EVIDENCE, EXAMPLES, examples

from shukotsu.study import finding_sentences
from shukotsu.study.finding_sentences import MISTAKES, key_of, what_of
from shukotsu.study.findings import SUSPECT, Finding, kinds, values_of


def test_every_kind_and_variant_is_here() -> None:
    assert MISTAKES.keys() == {key_of(*each) for each in EXAMPLES} & MISTAKES.keys()
    assert {key.partition("/")[0] for key in MISTAKES} == {*kinds()}
    assert {*finding_sentences.EVIDENCE} == {*EVIDENCE}


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
    assert what_of(swapped.kind, "", swapped.values) == (
        "The receivers index_middle and index_distal seem to be swapped"
    )
    assert swapped.message == (
        "The receivers index_middle and index_distal seem to be swapped (put right, the gap of index_pip "
        "falls from 31.2 to 1.4 mm; put right, the median gap of the joints concerned goes from 12.1 to "
        "1.3 mm, and 5 of 16 centres move by more than 2 mm); exchange these names in `receivers` of the "
        "mapping: index_middle with index_distal."
    )
    _, many = (
        Finding("hemisphere", SUSPECT, "left-out", each) for each in EXAMPLES["hemisphere", "left-out"]
    )
    assert "are left out (hand: 40, index_distal: 3): the tracker" in many.message
    turned = Finding("receiver-turned", SUSPECT, "one", EXAMPLES["receiver-turned", "one"][0])
    assert "by -90 deg about its y axis" in turned.message
    written = "`receiver_axes: {distal: [0, 1, 0], lateral: [-1, 0, 0], dorsal: [0, 0, 1]}`"
    assert f"write {written} under the segment hand in the layout" in turned.message
    inverse = Finding(
        "quaternion-order", SUSPECT, "inverse-too", EXAMPLES["quaternion-order", "inverse-too"][0]
    )
    keys = "`order: xyzw` and `rotates: transmitter-to-receiver`"
    assert inverse.message.endswith(f"; write {keys} under `orientation` in the mapping.")
