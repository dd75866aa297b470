"""When models give another answer."""

from __future__ import annotations

from typing import Any

import pytest

from shukotsu.stages.compare_movement.model_agreement import dependence_rows

WHERE = {"hand": "right", "task": "play", "quantity": "range_deg", "of": "thumb_ip flexion", "unit": "deg"}
LEVELS = {"factor": "group", "level": "A", "other_level": "B"}


def verdict_of(p: float | None) -> str:
    return "undecided" if p is None else "shown" if p <= 0.05 else "not-shown"


def difference(model: str, value: float, p: float | None) -> dict[str, Any]:
    return WHERE | LEVELS | {"model": model, "difference": value, "verdict": verdict_of(p)}


def icc(model: str, low: float, high: float) -> dict[str, Any]:
    middle = (low + high) / 2
    interval = {"icc_2_1": middle, "icc_2_1_low": low, "icc_2_1_high": high}
    return WHERE | {"across": "session", "model": model, "sem": 1.0 + low} | interval


@pytest.mark.parametrize(
    ("rows", "agree", "message"),
    [
        ([difference("a", 4.0, 0.01), difference("b", 9.0, 0.03)], True, ""),
        ([difference("a", 1.0, 0.6), difference("b", -1.0, 0.9)], True, ""),
        (
            [difference("a", 4.0, 0.01), difference("b", 3.0, 0.2)],
            False,
            "more at A: a; no difference shown: b",
        ),
        ([difference("a", 4.0, 0.01), difference("b", -3.0, 0.01)], False, "more at A: a; less at A: b"),
        ([difference("a", 4.0, None), difference("b", 3.0, None)], None, "fewer than two models have a test"),
    ],
)
def test_differences_agree_by_sign_and_significance(
    rows: list[dict[str, Any]], agree: bool | None, message: str
) -> None:
    (found,) = dependence_rows(rows, [])
    assert (found["agree"], found["message"]) == (agree, message)
    assert found["models"] == "a;b"


def test_the_two_models_that_part_most_are_named() -> None:
    rows = [difference("a", 1.0, 0.5), difference("b", 2.5, 0.5), difference("c", -1.0, 0.5)]
    (found,) = dependence_rows(rows, [])
    assert (found["which"], found["widest_difference"]) == ("b;c", 3.5)


def test_reliabilities_agree_where_their_intervals_overlap() -> None:
    (found,) = dependence_rows([], [icc("a", 0.5, 0.9), icc("b", 0.85, 0.95)])
    assert (found["agree"], found["factor"], found["level"]) == (True, "session", "")
    (found,) = dependence_rows([], [icc("a", 0.2, 0.6), icc("b", 0.85, 0.95)])
    assert (found["agree"], found["message"]) == (False, "ICC(2,1) is higher under b than under a")
