"""The coach by itself: what it asks, sees, finds and says, of simulated hands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from coached_hands import CALIBRATION, arriving, one_after_another, setup

from benchmarks.faultless_hands import exchanged
from shukotsu.coach.coach import CHECKING, ENOUGH, FIRST, MOST_ASKED, Coach, Request
from shukotsu.coach.live_poses import MOST_FRAMES, EvenFrames
from shukotsu.coach.requests import MEASURE, TOUCHING, Option
from shukotsu.coach.setup import check_names
from shukotsu.errors import InputError
from shukotsu.schemas.poses import Poses
from shukotsu.stages.fit_hand.receiver_frames import concatenated


def coached(poses: Poses, coach: Coach | None = None) -> Iterator[tuple[Coach, dict[str, Any]]]:
    coach = coach or Coach(setup())
    for arrived in arriving(poses):
        for state in coach.take(arrived):
            yield coach, state


@cache
def calibrated() -> tuple[Coach, tuple[dict[str, Any], ...]]:
    *states, (coach, last) = coached(one_after_another(CALIBRATION))
    return coach, (*(state for _, state in states), last)


def kinds(coach: Coach) -> list[str]:
    return [what["kind"] for _, what in coach.log]


@pytest.mark.slow
def test_the_first_request_comes_at_once_and_the_check_before_any_other() -> None:
    _, states = calibrated()
    assert states[0]["request"]["name"] == FIRST
    first_other = next(s for s in states if s["request"] is None or s["request"]["number"] > 1)
    checked = next(s for s in states if s["phase"] != CHECKING)
    assert checked["time_s"] <= 5.0 <= first_other["time_s"] + 5.0
    assert checked["time_s"] <= first_other["time_s"]


@pytest.mark.slow
def test_a_hand_that_does_what_is_asked_is_enough() -> None:
    coach, states = calibrated()
    last = states[-1]
    assert (last["phase"], last["settled"], last["of"]) == (ENOUGH, 15, 15)
    assert last["summary"].startswith("Calibrated in ")
    assert coach.summary()["left"] == []
    assert "done" in kinds(coach)


@pytest.mark.slow
def test_no_joint_has_a_number_before_the_first_estimate() -> None:
    _, states = calibrated()
    assert [state["joints"] for state in states if state["time_s"] < 3.0] == [[]] * 5


@pytest.mark.slow
def test_states_hang_on_the_frames_alone() -> None:
    """Not on what else the process did before."""
    _, states = calibrated()
    again = [state for _, state in coached(one_after_another(CALIBRATION))]
    assert again == list(states)


@pytest.mark.slow
def test_swapped_receivers_are_found_first_and_when_put_right_it_begins_anew() -> None:
    poses = one_after_another((("free", 9.0), ("spread", 5.0), ("thumb-circle", 6.0)))
    wrong = exchanged(poses.take(slice(0, 1500)), ("index_middle", "middle_middle"))
    coach = Coach(setup())
    states = [state for _, state in coached(wrong, coach)]
    found = next(state for state in states if state["findings"])
    assert found["time_s"] <= 5.0
    assert found["request"] is None
    assert "index_middle" in found["findings"][0]
    assert "middle_middle" in found["findings"][0]
    states = [state for _, state in coached(poses.take(slice(1500, None)), coach)]
    assert coach.restarts == 1
    assert states[-1]["findings"] == []
    assert states[-1]["of"] == 15
    assert coach.began_s > 1500 / 240


@pytest.mark.slow
def test_nothing_is_asked_for_more_than_three_times() -> None:
    """Of somebody who does nothing."""
    coach = Coach(setup())
    for _ in coached(one_after_another((("free", 5.0), ("rest", 40.0))), coach):
        pass
    asked: dict[str, int] = {}
    for _, what in coach.log:
        name = what.get("name", "")
        asked[name] = asked.get(name, 0) + (what["kind"] in ("asked", "further", "instead"))
    assert max(asked.values()) <= MOST_ASKED


@pytest.mark.slow
def test_a_little_further_is_said_of_half_a_movement() -> None:
    coach = Coach(setup(wanted_mm=1.2))
    poses = one_after_another((("free", 6.0), ("rest", 30.0)))
    said = [state["done"]["sentence"] for _, state in coached(poses, coach) if state["done"]]
    assert any("a little further" in sentence or "Going on" in sentence for sentence in said)


def test_a_hand_is_known_after_a_few_seconds() -> None:
    *_, (coach, state) = coached(one_after_another((("free", 5.1),)))
    assert coach.known is not None
    assert state["of"] == 15
    assert len(state["skeleton"]["points"]) == 21
    assert {own["verdict"] for own in state["joints"]} <= {"believe", "care", "no"}


def marked(marks: Sequence[Mapping[str, Any]]) -> tuple[Coach, dict[str, Any]]:
    coach = Coach(setup(points={"post": (300.0, 0.0, 0.0, 0.4)}))
    poses, states = one_after_another((("free", 9.0),)), list[dict[str, Any]]()
    for number, arrived in enumerate(arriving(poses)):
        own = [mark | {"host_ns": int(arrived.host_ns[0])} for mark in marks] if number == 20 else []
        states += coach.take(arrived, own)
    return coach, states[-1]


@pytest.mark.slow
def test_a_length_enters_the_next_estimate_and_is_taken_back() -> None:
    length = {"kind": "length", "quantity": "index_middle.lateral", "value_mm": 0.5, "sd_mm": 0.3}
    plain, with_it = marked([])[1], marked([length])[1]
    undone = marked([length, {"kind": "undo"}])[1]
    sd = [
        next(own["sd_mm"] for own in s["joints"] if own["joint"] == "index_dip")
        for s in (plain, with_it, undone)
    ]
    assert sd[1] < 0.95 * sd[0]
    assert sd[2] == sd[0]


@pytest.mark.slow
def test_a_marked_touch_is_held_in_the_frames_about_the_mark() -> None:
    coach, _ = marked([{"kind": "touch", "digit": "index", "meets": "thumb"}])
    (touch,) = coach.touches
    assert (touch.digit, touch.meets, touch.part) == ("index", "thumb", "pad")
    assert 100 <= len(touch.frames) <= 121


def test_an_answer_to_a_request_for_a_touch_is_taken_and_it_is_not_asked_for_again() -> None:
    coach = Coach(setup(points={"post": (300.0, 0.0, 0.0, 0.4)}, calliper=True))
    for state in (state for _, state in coached(one_after_another((("free", 5.1),)), coach)):
        assert state["request"] is not None
    for option in (
        Option(TOUCHING, "index", 5.0, np.ones(15)),
        Option(MEASURE, "index_middle", 20.0, np.ones(15)),
    ):
        coach.request = Request(9, option, coach.time_s)
        entry = {"kind": "touch", "digit": "index", "part": "tip", "point": "post"}
        if option.kind == MEASURE:
            entry = {"kind": "length", "quantity": "index_middle", "value_mm": 24.0, "sd_mm": 0.4}
        coach.take(None, [{**entry, "host_ns": 0}])
        assert coach.done is not None
        assert coach.done["kind"] == "entered"
        assert coach.request is None or coach.request.option.name != option.name


def asked_to_touch() -> Coach:
    """A coach that has asked for a touch two seconds ago."""
    coach = Coach(setup(points={"post": (300.0, 0.0, 0.0, 0.4)}))
    for _ in coached(one_after_another((("free", 5.1),)), coach):
        pass
    coach.request = Request(9, Option(TOUCHING, "index", 5.0, np.ones(15)), coach.time_s - 2.0)
    return coach


@pytest.mark.parametrize("mark", [{"kind": "button"}, {"kind": "done"}, {"kind": "done", "number": 9}])
def test_what_says_done_marks_the_touch_that_is_asked_for_once(mark: dict[str, Any]) -> None:
    coach = asked_to_touch()
    coach.take(None, [{**mark, "host_ns": at_ns} for at_ns in (0, 10**8, 2 * 10**8)])  # a switch that bounces
    assert [touch.digit for touch in coach.touches] == ["index"]
    assert coach.done is not None
    assert coach.done["kind"] == "entered"


def test_a_touch_that_comes_again_within_its_own_time_is_one() -> None:
    coach, mark = asked_to_touch(), {"kind": "touch", "digit": "ring", "meets": "thumb"}
    coach.take(None, [{**mark, "host_ns": at_ns} for at_ns in (0, 4 * 10**8, 9 * 10**8)])
    assert [touch.host_ns for touch in coach.touches] == [0, 9 * 10**8]


@pytest.mark.slow
def test_a_mark_at_a_wrong_moment_is_not_used_and_that_is_said_once() -> None:
    coach, state = marked([{"kind": "touch", "digit": "index", "meets": "thumb"}])
    assert [own["verdict"] for own in state["joints"]].count("no") == 0
    assert kinds(coach).count("not-used") == 1
    assert any("Not used: contact 1 (index and thumb)" in own["sentence"] for own in state["log"])


def test_a_place_may_lie_on_either_side_and_a_length_may_not() -> None:
    coach, sides = Coach(setup()), {"kind": "length", "value_mm": -1.2, "sd_mm": 0.4, "host_ns": 0}
    coach.take(None, [sides | {"quantity": name} for name in ("index_middle.lateral", "index_middle")])
    assert [(own.quantity, own.value_mm) for own in coach.measured] == [("index_middle.lateral", -1.2)]


def test_what_the_study_has_measured_is_changed_in_its_sheet() -> None:
    row = {"quantity": "index_middle", "value_mm": 23.5, "sd_mm": 0.4}
    coach = Coach(setup(measurements=(row,)))
    coach.take(None, [row | {"kind": "length", "value_mm": 25.9, "host_ns": 0}])
    assert coach.measured == []
    with pytest.raises(InputError, match=r"is 23\.5 mm in the sheet"):
        check_names(row, coach.layout, coach.setup)


@pytest.mark.parametrize(
    "mark",
    [
        {"kind": "length"},
        {"kind": "touch"},
        {"kind": ["a"]},
        {},
        {"kind": "length", "quantity": "index_middle", "value_mm": "x", "sd_mm": 1},
        {"kind": "length", "quantity": "nothing", "value_mm": 1.0, "sd_mm": 1.0},
        {"kind": "touch", "digit": "index", "part": "tip", "point": "nowhere"},
        {"kind": "undo"},
        {"kind": "skip"},
        {"kind": "done", "number": 5},
    ],
)
def test_what_nobody_could_have_entered_changes_nothing(mark: dict[str, Any]) -> None:
    coach = Coach(setup())
    assert coach.take(None, [{**mark, "host_ns": 0}]) == []
    assert coach.log == []
    assert coach.state()["log"] == []


def test_a_gap_of_an_hour_is_passed_over() -> None:
    coach, poses = Coach(setup()), one_after_another((("free", 2.0),))
    later = replace(poses, frame=poses.frame + 240 * 3600, time_s=poses.time_s + 3600.0)
    states = [state for _, state in coached(concatenated([poses, later]), coach)]
    assert len(states) < 12
    assert states[-1]["time_s"] > 3600.0


def test_a_receiver_that_sends_nothing_is_named() -> None:
    poses = one_after_another((("free", 5.1),))
    silent = poses.valid.copy()
    silent[:, poses.index("ring_middle")] = False
    *_, (_, state) = coached(replace(poses, valid=silent))
    assert any("ring_middle" in sentence and "connected" in sentence for sentence in state["findings"])


def test_memory_of_a_long_recording_is_bounded() -> None:
    frames, poses = EvenFrames(), one_after_another((("free", 9.0),))
    for _ in range(40):
        frames.add(poses)
    kept = frames.poses()
    assert len(kept.frame) <= MOST_FRAMES
    assert len({*kept.frame.tolist()}) > 100
