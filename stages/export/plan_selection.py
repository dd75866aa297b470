"""Which of a plan's recordings and models are exported."""

from __future__ import annotations

from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.schemas.plan import SubjectPlan
from shukotsu.schemas.study import Recording


def chosen_models(plan: SubjectPlan, path: Path, names_list: str) -> list[str]:
    """Return models of a comma-separated list, all of the plan's where it is empty.

    path : of the plan, for messages. Raises InputError where one is none.
    """
    names = list(dict.fromkeys(name.strip() for name in names_list.split(",") if name.strip()))
    for name in names:
        if name not in plan.models:
            raise InputError(f"--model: {path} has no model {name!r}; it has {', '.join(plan.models)}")
    return names or list(plan.models)


def chosen_recordings(plan: SubjectPlan, path: Path, hand: str, name: str) -> list[Recording]:
    """Return the recordings to export.

    hand : right or left, empty for both. name : the task, or TASK_TRIAL, which need not be evaluated, for its
    tables say more; empty for every recording that tips are evaluated on. Raises InputError where there is
    none, or several have the name.
    """
    if hand and hand not in plan.hands:
        raise InputError(
            f"--hand: {path} has no {hand} hand of {plan.who.label!r}; it has {', '.join(plan.hands)}"
        )
    chosen: list[Recording] = []
    for side in (hand,) if hand else plan.hands:
        if not name:
            chosen += plan.evaluated(side)
            continue
        of_hand = [recording for recording in plan.recordings if recording.hand.hand == side]
        named = [r for r in of_hand if name in (r.name, r.task, f"{r.task}_{r.trial}")]
        exact = [r for r in named if name in (r.name, f"{r.task}_{r.trial}") or not r.trial]
        if len(exact or named) != 1:
            raise InputError(
                f"--recording: {name!r} is not one recording of the {side} hand of {path}; expected one of "
                f"{', '.join(recording.name for recording in of_hand)}"
            )
        chosen += exact or named
    return chosen
