"""Define which of a plan's recordings and models are exported."""

from __future__ import annotations

from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.study import Recording


def chosen_models(plan: SubjectPlan, path: Path, names_list: str) -> list[str]:
    """Models of a comma-separated list, all of the plan's where it is empty; InputError where one is none.

    path : of the plan, for messages.
    """
    names = list(dict.fromkeys(name.strip() for name in names_list.split(",") if name.strip()))
    for name in names:
        if name not in plan.models:
            raise InputError(f"--model: {path} has no model {name!r}; it has {', '.join(plan.models)}")
    return names or list(plan.models)


def chosen_recordings(plan: SubjectPlan, path: Path, hand: str, name: str) -> list[list[Recording]]:
    """Recordings to export, each in a list, or with hand `both` those of either hand in one.

    hand : right, left, both, or empty for either by itself. name : the task, or TASK_TRIAL; empty for every
    recording that tips are evaluated on. Raises InputError where there is none, or several have the name.
    """
    sides = ("right", "left") if hand == "both" else ((hand,) if hand else plan.hands)
    for side in sides:
        if side not in plan.hands:
            raise InputError(
                f"--hand: {path} has no {side} hand of {plan.who.label!r}; it has {', '.join(plan.hands)}"
            )
    if hand != "both":
        return [[own] for side in sides for own in _of_hand(plan, path, side, name)]
    right, left = (_of_hand(plan, path, side, name) for side in sides)
    other = {recording.name: recording for recording in left}
    return [[own, other[own.name]] for own in right if own.name in other]


def _of_hand(plan: SubjectPlan, path: Path, hand: str, name: str) -> list[Recording]:
    """Recordings of one hand; with a name that one, which need not be evaluated: its tables say more."""
    if not name:
        return plan.evaluated(hand)
    own = [recording for recording in plan.recordings if recording.hand.hand == hand]
    named = [r for r in own if name in (r.name, r.task, f"{r.task}_{r.trial}")]
    exact = [r for r in named if name in (r.name, f"{r.task}_{r.trial}") or not r.trial]
    if len(exact or named) != 1:
        raise InputError(
            f"--recording: {name!r} is not one recording of the {hand} hand of {path}; expected one of "
            f"{', '.join(recording.name for recording in own)}"
        )
    return exact or named
