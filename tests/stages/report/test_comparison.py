"""Comparing models across subjects: statistics against other formulations, what is missing, words."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from stages.report.comparison import (
    ALL_DIGITS,
    EQUAL,
    FEWEST_SUBJECTS,
    METRICS,
    N_FLIPS,
    NO_NUMBER,
    NO_ROW,
    UNFIT,
    Comparison,
    Missing,
    Observation,
    bootstrap_tail,
    compare,
    effect_size,
    holm,
    interval_95,
    observed,
    paired,
    sign_flip_p,
    smallest_p,
    study_comparisons,
)
from stages.report.comparison_words import (
    caution,
    comparison_table,
    p_in_words,
    sentence,
)
from stages.report.study_results import StudyResults

TIP, LEFT_OUT = METRICS["true_tip_mean_mm"], METRICS["left_out_mean_mm"]
PAIR = ("whole-hand", "paper-fig4")
SKEWED = np.array([-0.9, -0.5, -0.45, -0.3, -0.2, -0.15, -0.1, 0.02, 0.3])

NUMBERS = st.floats(-20.0, 20.0).map(lambda value: round(value, 3))
STUDIES = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=18)


def _observations(values: Iterable[Sequence[float]], digit: str = "index") -> list[Observation]:
    """One place a subject: the numbers of PAIR."""
    return [
        Observation(f"S{subject:02}", model, digit, "right hand, rom", value)
        for subject, numbers in enumerate(values)
        for model, value in zip(PAIR, numbers, strict=True)
    ]


def _one(values: Iterable[Sequence[float]], pair: tuple[str, str] = PAIR) -> Comparison:
    """The comparison over all digits alone."""
    (found,) = compare(_observations(values), TIP, [pair], digits={ALL_DIGITS}, fitted={"whole-hand"})
    return found


def _of_differences(differences: Iterable[float]) -> Comparison:
    return _one([(2.0 + difference, 2.0) for difference in differences])


@pytest.mark.parametrize("n", [2, 5, 9])
def test_exact_p_is_scipys(n: int) -> None:
    """Enumerated sign flips of the mean, as scipy permutes samples of one pair each."""
    d = SKEWED[:n]
    expected = stats.permutation_test(
        (d,), lambda x, axis: np.mean(x, axis=axis), permutation_type="samples", n_resamples=np.inf
    )
    assert sign_flip_p(d) == pytest.approx(expected.pvalue, abs=1e-12)


def test_exact_p_counts_ties() -> None:
    """Flips that reach the same sum count, though their sums differ by rounding."""
    d = np.array([0.1, 0.2, 0.3, -0.3, 0.7, 0.1])
    sums = [
        abs(sum(s * round(10 * x) for s, x in zip(signs, d, strict=True)))
        for signs in product((1, -1), repeat=6)
    ]
    expected = np.mean([total >= 11 for total in sums])
    assert sign_flip_p(d) == expected


@pytest.mark.parametrize("n", [14, 15, 20])
def test_random_flips_are_near_the_exact_p(n: int) -> None:
    """Within Monte Carlo error of the enumeration, which sums one subject after the other."""
    d = np.random.default_rng(5).normal(0.4, 1.0, n)
    sums = np.zeros(1)
    for value in d:
        sums = np.concatenate([sums + value, sums - value])
    exact = float((np.abs(sums) >= abs(d.sum()) - 1e-9).mean())
    error = 0.0 if n <= 14 else 4 * math.sqrt(exact * (1 - exact) / N_FLIPS)
    assert 0.01 < exact < 0.5
    assert sign_flip_p(d) == pytest.approx(exact, abs=error + 1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 14, 15, 40])
def test_smallest_p_is_reached(n: int) -> None:
    """All subjects alike give it, exactly where all flips are tried; the data count as one."""
    p = sign_flip_p(np.full(n, -0.5))
    assert p == pytest.approx(smallest_p(n), abs=0.0 if n <= 14 else 4e-4)
    assert p >= smallest_p(n)
    assert smallest_p(FEWEST_SUBJECTS) <= 0.05 < smallest_p(FEWEST_SUBJECTS - 1)


def test_random_flips_count_ties() -> None:
    """Where one subject alone differs every flip reaches what was seen."""
    assert sign_flip_p(np.array([0.1, *[0.0] * 19])) == 1.0


def test_interval_is_scipys_percentile_bootstrap_with_wider_tails() -> None:
    """Ends within Monte Carlo error of scipy's at the widened level."""
    tail = bootstrap_tail(len(SKEWED))
    expected = stats.bootstrap(
        (SKEWED,),
        np.mean,
        n_resamples=20_000,
        confidence_level=1 - 2 * tail,
        method="percentile",
        random_state=np.random.default_rng(2),
    ).confidence_interval
    low, high = interval_95(SKEWED)
    assert low == pytest.approx(expected.low, abs=0.03)
    assert high == pytest.approx(expected.high, abs=0.03)
    assert high - low == pytest.approx(expected.high - expected.low, rel=0.035)
    plain = np.ptp(stats.bootstrap((SKEWED,), np.mean, method="percentile", rng=1).confidence_interval)
    assert high - low > 1.1 * plain


def test_tail_makes_a_normal_interval_students() -> None:
    """Where resampled means are normal the ends are those of the t interval."""
    for n in (6, 12, 100):
        spread = math.sqrt((n - 1) / n)  # of the resampled means, in standard errors
        assert -stats.norm.ppf(bootstrap_tail(n)) * spread == pytest.approx(stats.t.ppf(0.975, n - 1))


def test_interval_holds_the_mean_in_about_95_percent_of_studies() -> None:
    """Of 8 normal differences; the plain percentile interval does not."""
    rng, n, n_studies = np.random.default_rng(11), 8, 400
    samples = rng.normal(0.0, 1.0, (n_studies, n))
    ends = np.array([interval_95(sample) for sample in samples])
    held = np.mean((ends[:, 0] <= 0) & (ends[:, 1] >= 0))
    assert 0.92 <= held <= 0.97
    means = np.array([sample[rng.integers(0, n, (1000, n))].mean(axis=1) for sample in samples])
    plain = np.quantile(means, [0.025, 0.975], axis=1)
    assert np.mean((plain[0] <= 0) & (plain[1] >= 0)) < 0.91


def test_holm_by_hand() -> None:
    """0.01 x 4, 0.02 x 3, 0.03 x 2 raised to the one before, 0.9; no test stays none and does not count."""
    corrected = holm([0.02, None, 0.9, 0.01, 0.03])
    assert corrected == [
        pytest.approx(0.06),
        None,
        pytest.approx(0.9),
        pytest.approx(0.04),
        pytest.approx(0.06),
    ]
    assert holm([0.4, 0.5]) == [pytest.approx(0.8), pytest.approx(0.8)]
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_effect_size_by_hand() -> None:
    """Mean 3, SD sqrt(2.5), and the correction for 4 degrees of freedom, gamma(2) / (sqrt(2) gamma(1.5))."""
    d = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    correction = 1.0 / (math.sqrt(2.0) * math.sqrt(math.pi) / 2)
    assert effect_size(d) == pytest.approx(3.0 / math.sqrt(2.5) * correction)
    assert effect_size(-d) == pytest.approx(-3.0 / math.sqrt(2.5) * correction)
    assert effect_size(d[:2]) is None
    assert effect_size(np.full(9, 0.7)) is None


@settings(max_examples=30, deadline=None)
@given(STUDIES)
def test_swapping_the_models_flips_the_signs(values: list[tuple[float, float]]) -> None:
    """Means, interval and effect change sign, p does not, better becomes worse."""
    one, other = _one(values).found, _one(values, PAIR[::-1]).found
    assert one is not None
    assert other is not None
    assert (other.mean, other.median) == (-one.mean, -one.median)
    assert (other.lowest, other.highest) == (-one.highest, -one.lowest)
    assert (other.p, other.n_equal) == (one.p, one.n_equal)
    assert other.n_better == one.n - one.n_better - one.n_equal
    if one.interval is not None:
        assert other.interval == pytest.approx((-one.interval[1], -one.interval[0]), abs=1e-9)
    if one.effect is not None:
        assert other.effect == pytest.approx(-one.effect)


@settings(max_examples=30, deadline=None)
@given(STUDIES, st.integers(-64, 64))
def test_a_constant_added_to_both_changes_nothing(values: list[tuple[float, float]], constant: int) -> None:
    """Only differences count."""
    one = _one(values).found
    other = _one([(mine + constant, theirs + constant) for mine, theirs in values]).found
    assert one is not None
    assert other is not None
    assert (other.p, other.n_better, other.n_equal) == (one.p, one.n_better, one.n_equal)
    assert (other.mean, other.median) == pytest.approx((one.mean, one.median), abs=1e-9)
    if one.interval is not None:
        assert other.interval == pytest.approx(one.interval, abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(STUDIES, st.randoms(use_true_random=False))
def test_order_does_not_matter(values: list[tuple[float, float]], shuffler: random.Random) -> None:
    """The same bytes from observations in any order, and again from the same."""
    told = _observations(values) + _observations(values[::-1], "thumb")
    pairs = [PAIR]
    first = compare(told, TIP, pairs, digits={ALL_DIGITS, "thumb"})
    assert compare(told, TIP, pairs, digits={ALL_DIGITS, "thumb"}) == first
    shuffler.shuffle(told)
    by_digit = {each.digit: each for each in compare(told, TIP, pairs, digits={ALL_DIGITS, "thumb"})}
    assert by_digit == {each.digit: each for each in first}


def test_comparisons_share_what_is_random() -> None:
    """The same flips and resamples for all of so many subjects: what is scaled or mirrored gives the same."""
    differences = np.random.default_rng(2).normal(0.3, 1.0, 30)
    one, other = paired(differences), paired(-2.0 * differences)
    assert one.interval is not None
    assert other.interval == pytest.approx((-2.0 * one.interval[1], -2.0 * one.interval[0]))
    assert one.p == other.p == paired(differences).p
    assert paired(differences[::-1]).p == pytest.approx(one.p, abs=0.02)


def test_a_subject_counts_once_however_much_was_recorded() -> None:
    """Hands, tasks and digits of one subject are averaged before subjects are."""
    told = _observations([(1.0, 2.0), (2.0, 2.0), (2.0, 4.0)])
    told += [
        Observation("S00", model, digit, place, value)
        for digit, place in product(("index", "ring"), ("left hand, rom", "right hand, grip, trial 2"))
        for model, value in zip(PAIR, (4.0, 8.0), strict=True)
    ]
    overall, index, ring = compare(told, TIP, [PAIR])
    assert [each.digit for each in (overall, index, ring)] == [ALL_DIGITS, "index", "ring"]
    assert [pair.difference for pair in overall.subjects] == [pytest.approx(-17 / 5), 0.0, -2.0]
    assert [pair.n_places for pair in overall.subjects] == [5, 1, 1]
    assert overall.found is not None
    assert overall.found.mean == pytest.approx((-17 / 5 - 2) / 3)
    assert (overall.found.n, overall.found.n_better, overall.found.n_equal) == (3, 2, 1)
    assert [pair.difference for pair in index.subjects] == [pytest.approx(-3.0), 0.0, -2.0]
    assert [pair.difference for pair in ring.subjects] == [-4.0, None, None]


def test_only_shared_places_are_compared() -> None:
    """A model that failed where it is hard gains nothing by it, and the failure is told."""
    told = _observations([(1.0, 1.5)] * 2)
    told += [
        Observation("S00", PAIR[0], "index", "right hand, hard", None, "no hand was fitted."),
        Observation("S00", PAIR[1], "index", "right hand, hard", 40.0),
    ]
    (found,) = compare(told, TIP, [PAIR], digits={ALL_DIGITS})
    first = found.subjects[0]
    assert (first.value, first.other, first.difference) == (1.0, 1.5, -0.5)
    assert (first.n_shared, first.n_places) == (1, 2)
    assert first.missing == (Missing(PAIR[0], "index", "right hand, hard", "no hand was fitted."),)
    assert "Compared in 2 of 3 places, where both have a number." in sentence(found)


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
    (found,) = compare(told, TIP, [PAIR], subjects=extra, digits={ALL_DIGITS})
    assert [pair.subject for pair in found.subjects] == [f"S{i:02}" for i in range(len(there))] + extra
    for pair, known in zip(found.subjects, there, strict=False):
        assert (pair.difference is not None) == all(known)
        assert [each.model for each in pair.missing] == [m for m, k in zip(PAIR, known, strict=True) if not k]
        assert (pair.value is not None, pair.other is not None) == known
    for pair in found.subjects[len(there) :]:
        assert pair.missing == tuple(Missing(model, "", "", NO_ROW) for model in PAIR)
    assert (found.found.n if found.found else 0) == sum(map(all, there))


def test_a_place_observed_twice_is_refused() -> None:
    """A caller that forgot what tells places apart must not get a mean of some of them."""
    with pytest.raises(ValueError, match="two observations of whole-hand in index, right hand, rom: S00"):
        _one([(1.0, 2.0)]).found, compare(_observations([(1.0, 2.0)]) * 2, TIP, [PAIR])


def test_all_comparisons_of_a_call_are_corrected_together() -> None:
    """Every pair and digit, also those that cannot be significant; not those without a subject."""
    told = _observations([(1.0, 2.0 + 0.1 * s) for s in range(8)])
    told += _observations([(1.0, 2.0), (1.0, 3.0)], "ring")
    told += [Observation("S00", "rigid", "thumb", "right hand, rom", 3.0)]
    made = compare(told, TIP, [PAIR, ("rigid", "paper-fig4")])
    tested = [each for each in made if each.found is not None]
    assert [(each.model, each.digit) for each in tested] == [
        (PAIR[0], d) for d in (ALL_DIGITS, "index", "ring")
    ]
    assert {each.n_compared for each in made} == {3}
    p = [each.found.p for each in tested if each.found]
    assert p == [pytest.approx(2 / 256), pytest.approx(2 / 256), pytest.approx(0.5)]
    assert [each.p_holm for each in tested] == [
        pytest.approx(6 / 256),
        pytest.approx(6 / 256),
        pytest.approx(0.5),
    ]


def test_sentence_of_a_difference() -> None:
    """Model, amount, interval, subjects, corrected p; the direction is in the words."""
    d = [-0.31 + 0.02 * (k - 5.5) for k in range(12)]
    found = _of_differences(d)
    assert found.found is not None
    assert found.found.interval is not None
    assert found.found.interval[0] < -0.31 < found.found.interval[1] < 0
    low, high = (f"{-end:.2f}" for end in found.found.interval[::-1])
    assert sentence(replace(found, metric=METRICS["error_mm"])) == (
        "With whole-hand the joint centre is off by 0.31 mm less than with paper-fig4 "
        f"(95 % interval {low} to {high} mm; 12 subjects, 12 of 12 better; p = 0.00049)."
    )
    worse = sentence(_of_differences([-value for value in d]))
    assert "by 0.31 mm more than with paper-fig4 (95 % interval 0.2" in worse
    assert " mm; 12 subjects, 0 of 12 better; p = 0.00049)." in worse
    together = compare(_observations([(2.0 + value, 2.0) for value in d]), TIP, [PAIR])
    assert "p = 0.00098, Holm-corrected over 2)" in sentence(together[1])
    assert sentence(together[1]).startswith("Index: with whole-hand the fingertip is missed by")


def test_sentence_without_a_difference() -> None:
    """Nothing is claimed, whichever way the mean lies."""
    found = _of_differences([-0.4, 0.3, -0.2, 0.25, 0.0, 0.3, -0.2])
    assert not found.significant
    assert sentence(found).startswith(
        "No difference shown between whole-hand and paper-fig4: the fingertip is missed by 0.01 mm more with "
        "whole-hand (95 % interval -0."
    )
    assert "; 7 subjects, 3 of 7 better, 1 the same; p = 1)" in sentence(found)


def test_sentence_claims_nothing_that_the_correction_takes_back() -> None:
    """Nine subjects differ at the level by themselves, not as one of two comparisons."""
    made = compare(_observations([(1.96 + value, 2.0) for value in SKEWED]), TIP, [PAIR])
    assert made[0].found is not None
    assert made[0].found.p <= 0.05 < 2 * made[0].found.p
    assert sentence(made[0]).startswith("No difference shown between whole-hand and paper-fig4: ")


@pytest.mark.parametrize(("n", "least"), [(1, "1"), (2, "0.5"), (3, "0.25"), (5, "0.062")])
def test_sentence_of_too_few_subjects(n: int, least: str) -> None:
    """No claim, no interval, no p: only what was seen."""
    text = sentence(_of_differences([-1.0, -3.0, -2.0, -2.5, -1.5][:n]))
    who = "1 subject" if n == 1 else f"{n} subjects"
    assert text.startswith(
        f"{who} cannot show a difference between whole-hand and paper-fig4: the smallest p that the test can "
        f"give is {least}. The fingertip is missed by "
    )
    assert f"{who}, {n} of {n} better)." in text
    assert ("subjects from 1.00 to 3.00 mm" in text) == (n > 1)
    assert "interval" not in text
    assert "p =" not in text


def test_sentence_of_too_many_comparisons() -> None:
    """Seven subjects could show one difference, not one of four."""
    told = [each for digit in ("thumb", "index", "ring") for each in _observations([(1.0, 2.0)] * 7, digit)]
    made = compare(told, TIP, [PAIR])
    assert not any(each.significant for each in made)
    assert sentence(made[0]).startswith(
        "7 subjects cannot show a difference between whole-hand and paper-fig4: the smallest p that the test "
        "can give, Holm-corrected over 4, is 0.062. The fingertip"
    )
    assert compare(told, TIP, [PAIR], digits={ALL_DIGITS})[0].significant


def test_sentence_of_equal_and_of_missing_models() -> None:
    """The same in all subjects; no subject with both, with reasons, the first few by name."""
    same = _one([(1.0, 1.0), (2.0, 2.0 + EQUAL / 2)])
    assert sentence(same).startswith(
        "No difference at all between whole-hand and paper-fig4 in 2 subjects: the fingertip is missed by as "
        "much."
    )
    assert same.found is not None
    assert (same.found.p, same.found.n_equal) == (1.0, 2)
    told = [Observation(f"S{k}", PAIR[0], "index", "right hand, rom", None, "no hand.") for k in range(5)]
    (found,) = compare(told, LEFT_OUT, [PAIR], digits={ALL_DIGITS})
    assert (found.found, found.p_holm, found.n_compared) == (None, None, 0)
    gone = ", ".join(f"S{k} (whole-hand: no hand; paper-fig4: not scored)" for k in range(3))
    assert sentence(found).startswith(
        "Nothing to compare whole-hand and paper-fig4 by: no subject has a number of both. "
        f"Not compared: {gone} and 2 more."
    )


def test_p_never_rounds_over_the_level() -> None:
    """Two digits, unless they would say the opposite of what the sentence says."""
    texts = {0.0123: "p = 0.012", 0.05: "p = 0.05", 0.0502: "p = 0.0502", 0.0498: "p = 0.05", 1.0: "p = 1"}
    assert {p: p_in_words(p) for p in texts} == texts
    assert p_in_words(0.00005) == "p < 0.0001"


def test_cautions() -> None:
    """Two tests in one column, tips that nobody knows, and numbers that judge no skeleton say so."""
    tip = _of_differences([0.1])
    assert caution(tip) == "paper-fig4 knows no fingertip but the distal receiver's origin."
    assert caution(replace(tip, fitted=frozenset(PAIR))) == ""
    assert caution(replace(tip, other="true-skeleton")) == ""
    left_out = replace(tip, metric=LEFT_OUT)
    assert caution(left_out).startswith("Not one test for both: paper-fig4 replays its receivers")
    assert caution(replace(left_out, fitted=frozenset())).startswith(
        "Both replay their receivers. It says how"
    )
    assert caution(replace(left_out, fitted=frozenset(PAIR))) == ""
    assert sentence(replace(tip, metric=METRICS["mean_mm"])).endswith("not where they are.")


def test_tables_hold_every_number_and_every_subject() -> None:
    """A block a pair or a digit, cells as wide as their header, dashes where there is no number."""
    told = _observations([(1.0, 1.5 + 0.1 * k) for k in range(8)])
    told += [Observation("S99", PAIR[0], "index", "right hand, rom", 4.0)]
    told += [Observation("S99", "rigid", "ring", "right hand, rom", None, "why")]
    made = compare(told, TIP, [PAIR, ("rigid", "paper-fig4")], fitted={"whole-hand"})
    table = comparison_table(made)
    assert table is not None
    ours, rigid = table.blocks
    assert [row[0] for row in ours.rows] == ["All digits", "Index", "Ring"]
    found = made[0].found
    assert found is not None
    assert found.interval is not None
    interval = f"{found.interval[0]:.2f} to {found.interval[1]:.2f}"
    assert ours.rows[0] == (
        *("All digits", "8 of 9", "1.00", "1.85", "-0.85", "-0.85", interval, "0.0078", "0.016"),
        *(f"{found.effect:.2f}", "8 of 8"),
    )
    assert rigid.rows[0][:3] == ("All digits", "0 of 9", "–")
    assert all(len(row) == len(block.header) for block in table.blocks for row in block.rows)
    assert "corrected by Holm over 2 comparisons" in table.notes[0]
    assert comparison_table([]) is None


@pytest.mark.parametrize("held_out", [True, False])
def test_a_study_is_compared_as_its_rows_say(fitted: StudyResults, held_out: bool) -> None:
    """The subject's mean over hands and digits of the rows of one kind, where both models have one."""
    overall, *digits = study_comparisons(fitted, TIP, held_out=held_out)
    assert (overall.model, overall.other) == PAIR
    assert [each.digit for each in digits] == ["thumb", "index", "middle", "ring", "little"]
    (pair,) = overall.subjects
    for model, value in ((overall.model, pair.value), (overall.other, pair.other)):
        rows = [r for r in fitted.scores if (r["model"], r["held_out"]) == (model, held_out)]
        known = [r["true_tip_mean_mm"] for r in rows if r["true_tip_mean_mm"] is not None]
        assert value == pytest.approx(np.mean(known))
        assert pair.n_shared == len(known)
    assert {(each.digit, each.reason) for each in pair.missing} == {("ring", "joint ring_dip failed")}
    assert overall.fitted == {"whole-hand"}


def test_joint_errors_are_those_of_skeletons_that_are_judged(fitted: StudyResults) -> None:
    """Made from rom, which alone is held out here, not from opposition; a reference was made from nothing."""
    rows = [
        {**row, "error_mm": row["error_mm"] + 100.0}
        if row["calibrated_on"] == "opposition" and row["error_mm"] is not None
        else row
        for row in fitted.joint_errors
    ]
    pairs, moved = [("whole-hand", "prior-only")], replace(fitted, joint_errors=rows)
    (found,) = study_comparisons(moved, METRICS["error_mm"], pairs=pairs, digits={"little"})
    (pair,) = found.subjects
    for made, value in ((("whole-hand", "rom"), pair.value), (("prior-only", ""), pair.other)):
        mine = [row for row in rows if (row["model"], row["calibrated_on"]) == made]
        assert value == pytest.approx(
            np.mean([r["error_mm"] for r in mine if r["joint"].startswith("little")])
        )
    assert pair.n_shared == 6
    (seen,) = study_comparisons(moved, METRICS["error_mm"], held_out=False, pairs=pairs, digits={"little"})
    assert seen.subjects[0].value == pytest.approx((pair.value or 0.0) + 100.0)


def test_a_reference_stands_beside_either_kind(fitted: StudyResults) -> None:
    """It was made from no task, so it is compared held out and in-sample."""
    for held_out in (True, False):
        (found,) = study_comparisons(
            fitted, TIP, held_out=held_out, pairs=[("whole-hand", "prior-only")], digits={"thumb"}
        )
        assert found.subjects[0].other == pytest.approx(3.9)
        assert caution(found) == ""


def test_tip_errors_are_those_of_the_least_squares_binding(fitted: StudyResults) -> None:
    """The paper's first-frame binding is a table of its own."""
    (found,) = study_comparisons(fitted, METRICS["mean_mm"], held_out=False, digits={"thumb"})
    rows = [
        row["mean_mm"]
        for row in fitted.tip_errors
        if (row["model"], row["digit"], row["binding"]) == ("paper-fig4", "thumb", "least-squares")
    ]
    assert found.subjects[0].other == pytest.approx(np.mean(rows))


def test_what_does_not_fit_is_told(fitted: StudyResults, results: StudyResults) -> None:
    """No held-out replays, an excluded or failed recording, and a number that only one model has."""
    (replay,) = study_comparisons(fitted, METRICS["mean_mm"], digits={ALL_DIGITS})
    assert {each.reason for each in replay.subjects[0].missing} == {UNFIT[True]}
    seen = observed(fitted, METRICS["posed_mean_mm"], PAIR, held_out=False)
    assert {each.reason for each in seen if each.model == "paper-fig4"} == {
        NO_NUMBER,
        "joint ring_dip failed",
    }
    told = observed(results, METRICS["replay_mean_mm"], ["rigid"], held_out=False)
    failed = [each for each in told if each.reason.startswith("failed: ")]
    assert {each.place for each in failed} == {"left hand, opposition"}
    assert len(failed) == 5
    assert len({each.subject for each in told}) == 2
