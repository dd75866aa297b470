"""Comparing models across subjects: what counts, what is missing, and what is said of it."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.report.comparison.answers import NO_NUMBER, OTHER_KIND, Observation, observations
from stages.report.comparison.comparison_text import p_text
from stages.report.comparison.comparisons import ALL_DIGITS, NO_ROW, Comparison, Missing, compare
from stages.report.comparison.questions import JOINT_ERROR, REPLAY, TRUE_TIP
from stages.report.study_results import StudyResults

PAIR = ("whole-hand", "paper-fig4")

NUMBERS = st.floats(-20.0, 20.0).map(lambda value: round(value, 3))
STUDIES = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=18)


def _observations(values: Iterable[Sequence[float]], digit: str = "index") -> list[Observation]:
    """One place a subject: the numbers of PAIR."""
    return [
        Observation(f"S{subject:02}", model, digit, "right hand, rom", value)
        for subject, numbers in enumerate(values)
        for model, value in zip(PAIR, numbers, strict=True)
    ]


def _compare(
    seen: Iterable[Observation], pairs: Sequence[tuple[str, str]] = (PAIR,), digits: set[str] | None = None
) -> tuple[Comparison, ...]:
    return compare(pd.DataFrame(seen), TRUE_TIP, pairs, digits=digits)


@settings(max_examples=20, deadline=None)
@given(STUDIES, st.randoms(use_true_random=False))
def test_order_does_not_matter(values: list[tuple[float, float]], shuffler: random.Random) -> None:
    """The same bytes from observations in any order, and again from the same."""
    told = _observations(values) + _observations(values[::-1], "thumb")
    first = _compare(told, digits={ALL_DIGITS, "thumb"})
    assert _compare(told, digits={ALL_DIGITS, "thumb"}) == first
    shuffler.shuffle(told)
    by_digit = {each.digit: each for each in _compare(told, digits={ALL_DIGITS, "thumb"})}
    assert by_digit == {each.digit: each for each in first}


def test_a_subject_counts_once_however_much_was_recorded() -> None:
    """Hands, tasks and digits of one subject are averaged before subjects are."""
    told = _observations([(1.0, 2.0), (2.0, 2.0), (2.0, 4.0)])
    told += [
        Observation("S00", model, digit, place, value)
        for digit, place in product(("index", "ring"), ("left hand, rom", "right hand, grip, trial 2"))
        for model, value in zip(PAIR, (4.0, 8.0), strict=True)
    ]
    overall, index, ring = _compare(told)
    assert [each.digit for each in (overall, index, ring)] == [ALL_DIGITS, "index", "ring"]
    assert [pair.difference for pair in overall.subjects] == [pytest.approx(-17 / 5), 0.0, -2.0]
    assert [pair.n_places for pair in overall.subjects] == [5, 1, 1]
    assert overall.statistics is not None
    assert overall.statistics.mean == pytest.approx((-17 / 5 - 2) / 3)
    assert (overall.statistics.n, overall.statistics.n_better, overall.statistics.n_equal) == (3, 2, 1)
    assert [pair.difference for pair in index.subjects] == [pytest.approx(-3.0), 0.0, -2.0]
    assert [pair.difference for pair in ring.subjects] == [-4.0, None, None]


def test_only_shared_places_are_compared() -> None:
    """A model that failed where it is hard gains nothing by it, and the failure is told."""
    told = _observations([(1.0, 1.5 + 0.1 * k) for k in range(8)])
    told += [
        Observation("S00", PAIR[0], "index", "right hand, hard", None, "no hand was fitted."),
        Observation("S00", PAIR[1], "index", "right hand, hard", 40.0),
    ]
    (found,) = _compare(told, digits={ALL_DIGITS})
    first = found.subjects[0]
    assert (first.value, first.other, first.difference) == (1.0, 1.5, -0.5)
    assert (first.n_shared, first.n_places) == (1, 2)
    assert first.missing == (Missing(PAIR[0], "index", "right hand, hard", "no hand was fitted."),)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=8), st.integers(0, 2))
def test_every_subject_is_listed(there: list[tuple[bool, bool]], more: int) -> None:
    """Compared, or with each model that is missing and the reason."""
    told = [
        Observation(
            f"S{subject:02}",
            model,
            "index",
            "right hand, rom",
            1.0 if known else None,
            "" if known else "why",
        )
        for subject, pair in enumerate(there)
        for model, known in zip(PAIR, pair, strict=True)
    ]
    extra = [f"T{index}" for index in range(more)]
    (found,) = compare(pd.DataFrame(told), TRUE_TIP, [PAIR], subjects=extra, digits={ALL_DIGITS})
    assert [pair.subject for pair in found.subjects] == [f"S{i:02}" for i in range(len(there))] + extra
    for pair, known in zip(found.subjects, there, strict=False):
        assert (pair.difference is not None) == all(known)
        assert [each.model for each in pair.missing] == [m for m, k in zip(PAIR, known, strict=True) if not k]
        assert (pair.value is not None, pair.other is not None) == known
    for pair in found.subjects[len(there) :]:
        assert pair.missing == tuple(Missing(model, "", "", NO_ROW) for model in PAIR)
    assert (found.statistics.n if found.statistics else 0) == sum(map(all, there))


def test_a_place_observed_twice_is_refused() -> None:
    """A caller that forgot what tells places apart must not get a mean of some of them."""
    with pytest.raises(ValueError, match="duplicate"):
        _compare(_observations([(1.0, 2.0)]) * 2)


def test_all_comparisons_of_a_call_are_corrected_together() -> None:
    """Every pair and digit, also those that cannot be significant; not those without a subject."""
    told = _observations([(1.0, 2.0 + 0.1 * s) for s in range(8)])
    told += _observations([(1.0, 2.0), (1.0, 3.0)], "ring")
    told += [Observation("S00", "rigid", "thumb", "right hand, rom", 3.0)]
    made = _compare(told, [PAIR, ("rigid", "paper-fig4")])
    tested = [each for each in made if each.statistics is not None]
    assert [(each.model, each.digit) for each in tested] == [
        (PAIR[0], d) for d in (ALL_DIGITS, "index", "ring")
    ]
    assert {each.n_compared for each in made} == {3}
    p = [each.statistics.p for each in tested if each.statistics]
    assert p == [pytest.approx(2 / 256), pytest.approx(2 / 256), pytest.approx(0.5)]
    assert [each.p_holm for each in tested] == [
        pytest.approx(6 / 256),
        pytest.approx(6 / 256),
        pytest.approx(0.5),
    ]


def test_p_never_rounds_over_the_level() -> None:
    """Two digits, unless they would say the opposite of what the sentence says."""
    texts = {0.0123: "p = 0.012", 0.05: "p = 0.05", 0.0502: "p = 0.0502", 0.0498: "p = 0.05", 1.0: "p = 1"}
    assert {p: p_text(p) for p in texts} == texts
    assert p_text(0.00005) == "p < 0.0001"


def _study(
    results: StudyResults, question=TRUE_TIP, pair: tuple[str, str] = PAIR, *, held_out: bool = True
) -> dict[str, Comparison]:
    """By digit."""
    seen = observations(results, question, pair, held_out=held_out)
    return {each.digit: each for each in compare(seen, question, [pair], held_out=held_out)}


@pytest.mark.parametrize("held_out", [True, False])
def test_a_study_is_compared_as_its_rows_say(fitted: StudyResults, held_out: bool) -> None:
    """The subject's mean over hands and digits of the rows of one kind, where both models have one."""
    compared = _study(fitted, held_out=held_out)
    assert list(compared) == [ALL_DIGITS, "thumb", "index", "middle", "ring", "little"]
    (pair,) = compared[ALL_DIGITS].subjects
    for model, value in zip(PAIR, (pair.value, pair.other), strict=True):
        rows = [r for r in fitted.scores if (r["model"], r["held_out"]) == (model, held_out)]
        known = [r["true_tip_mean_mm"] for r in rows if r["true_tip_mean_mm"] is not None]
        assert value == pytest.approx(np.mean(known))
        assert pair.n_shared == len(known)
    assert {(each.digit, each.reason) for each in pair.missing} == {("ring", "joint ring_dip failed")}


def test_joint_errors_are_those_of_skeletons_that_are_judged(fitted: StudyResults) -> None:
    """Made from rom, which alone is held out here, not from opposition; a reference was made from nothing."""
    rows = [
        {**row, "error_mm": row["error_mm"] + 100.0}
        if row["calibrated_on"] == "opposition" and row["error_mm"] is not None
        else row
        for row in fitted.joint_errors
    ]
    against, moved = ("whole-hand", "prior-only"), replace(fitted, joint_errors=rows)
    (pair,) = _study(moved, JOINT_ERROR, against)["little"].subjects
    for made, value in ((("whole-hand", "rom"), pair.value), (("prior-only", ""), pair.other)):
        mine = [row for row in rows if (row["model"], row["calibrated_on"]) == made]
        assert value == pytest.approx(
            np.mean([r["error_mm"] for r in mine if r["joint"].startswith("little")])
        )
    assert pair.n_shared == 6
    seen = _study(moved, JOINT_ERROR, against, held_out=False)["little"]
    assert seen.subjects[0].value == pytest.approx((pair.value or 0.0) + 100.0)


@pytest.mark.parametrize("held_out", [True, False])
def test_a_reference_stands_beside_either_kind(fitted: StudyResults, held_out: bool) -> None:
    """It was made from no task, so it is compared held out and in-sample."""
    compared = _study(fitted, TRUE_TIP, ("whole-hand", "prior-only"), held_out=held_out)
    assert compared["thumb"].subjects[0].other == pytest.approx(3.9)


def test_why_there_is_no_number(fitted: StudyResults, results: StudyResults) -> None:
    """No held-out score, no such number, a message of the score, a recording that failed."""
    posed = replace(REPLAY, metric="posed_mean_mm")
    seen = observations(fitted, posed, PAIR, held_out=False)
    assert set(seen[seen["model"] == "paper-fig4"]["reason"]) == {NO_NUMBER, "joint ring_dip failed"}
    in_sample = replace(fitted, scores=[row for row in fitted.scores if not row["held_out"]])
    assert set(observations(in_sample, REPLAY, PAIR, held_out=True)["reason"]) == {OTHER_KIND[True]}
    told = observations(results, REPLAY, ["rigid"], held_out=False)
    failed = told[told["reason"].str.startswith("failed: ")]
    assert (set(failed["place"]), len(failed)) == ({"left hand, opposition"}, 5)
    assert told["subject"].nunique() == 2


def test_a_suspect_hand_is_in_no_statistic(fitted: StudyResults) -> None:
    problem = {"subject": "S01", "session": "", "hand": "left", "severity": "suspect"}
    seen = observations(replace(fitted, problems=[problem]), TRUE_TIP, PAIR, held_out=True)
    assert set(seen["place"]) == {"right hand, opposition"}
