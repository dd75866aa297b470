"""Questions of a study file: an outcome of movement, and what it is asked to differ or to change with."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError, guess, listed
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.quantities import ANGLE_OF, QUANTITIES, Quantity

ANGLES = ("flexion", "abduction", "rotation")
PARTS = ("joint", "angle", "digit", "other_digit", "measure")
"""Keys that say whose the outcome is."""
MEASURE = (
    r"independence|(contact_speed(_in_hand)?|peak_speed_(before|after)|touch_height|key_down_lag|held|interval|"
    r"hand_displacement|hand_turn|(cmc|mcp|pip|dip|ip)_flexion_(at_contact|range))(_variability)?"
)
"""Measures of a digit's strokes in event_measures."""
FEWEST_VALUES = 3
"""Of a covariate; what has fewer is a factor."""

Pair = tuple[str, str]
Levels = Sequence[Mapping[str, str]]


@dataclass(frozen=True)
class Question:
    """One question, every default filled in but the model: empty for the study's recommended one.

    quantity : a column of movement; empty of a curve, which is an angle's over the cycles of an event.
    of : values of the columns that say whose it is. factor : what tells `levels` apart, or the covariate,
    which has none; levels of `crossed_with` are empty where nothing is crossed. hand, task : empty where
    that is the factor, or where everybody has one hand.
    """

    name: str
    quantity: str
    curve: str
    of: tuple[str, ...]
    factor: str
    levels: Pair | tuple[()]
    crossed_with: str
    crossed_levels: Pair | tuple[()]
    hand: str
    task: str
    design: str
    model: str

    @property
    def factors(self) -> tuple[str, ...]:
        """Columns of the sheets that it speaks of."""
        return (self.factor, self.crossed_with) if self.crossed_with else (self.factor,)

    @property
    def outcome(self) -> Quantity | None:
        """Its quantity; None of a curve."""
        return next((own for own in QUANTITIES if own.name == self.quantity and not self.curve), None)

    @property
    def whose(self) -> str:
        """The same as column `of` of tables has it."""
        return (self.outcome.joined_by if self.outcome else " ").join(self.of)

    @property
    def digest(self) -> str:
        """Digest of what it asks, however it is called and in whichever order its levels stand."""
        content = asdict(replace(self, name="")) | {
            name: sorted(getattr(self, name)) for name in ("levels", "crossed_levels")
        }
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class FirstAsked:
    """When a question was first run, by its digest; after_results : whether there were results by then."""

    digest: str
    name: str
    first_asked: str
    after_results: bool


def read_asked(path: Path | None) -> list[FirstAsked]:
    """Read the record of when each question was first run; without one nothing is known.

    Raises InputError where it is not as it was written.
    """
    if path is None:
        return []
    try:
        return [FirstAsked(**entry) for entry in json.loads(path.read_text("utf-8"))]
    except (OSError, ValueError, TypeError):
        raise InputError(
            f"{path}: is no record of when each question was first run; put the file back as it was, or "
            "remove it, and the record begins anew"
        ) from None


def columns_asked(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Give the columns of the sheets that questions speak of, and the key that names each."""
    return {
        entry[key]: f"questions: {entry['name']!r}: {key}"
        for entry in entries
        for key in ("factor", "crossed_with", "covariate")
        if key in entry
    }


def checked_questions(
    entries: Sequence[Mapping[str, Any]],
    levels: Levels,
    models: Collection[str],
    layouts: Collection[Layout],
    events: Collection[str] | None,
    where: str,
) -> tuple[Question, ...]:
    """Check the study file's questions and fill in what they leave out.

    levels : a row a recording, as `schemas.factors.factor_levels` gives them. events : names of the study's
    events, None where files say them. Raises InputError that names the question and what was expected.
    """
    questions: list[Question] = []
    for entry in entries:
        try:
            own = _question(entry, levels, models, layouts, events)
            _check_twins(own, questions)
        except ValueError as error:
            raise InputError(f"{where}: questions: {entry['name']!r}: {error}") from None
        questions.append(own)
    return tuple(questions)


def _check_twins(question: Question, before: Sequence[Question]) -> None:
    for own in before:
        if own.name == question.name:
            raise ValueError("two questions have that name; rename one")
        if own.digest == question.digest:
            raise ValueError(f"asks what {own.name!r} asks; leave one out")


def _question(
    entry: Mapping[str, Any],
    levels: Levels,
    models: Collection[str],
    layouts: Collection[Layout],
    events: Collection[str] | None,
) -> Question:
    """One question; ValueError says what is wrong with it."""
    if ("factor" in entry) == ("covariate" in entry):
        raise ValueError("expected one of factor and covariate")
    factor = entry.get("factor", entry.get("covariate", ""))
    crossed = entry.get("crossed_with", "")
    odd = [key for key in ("levels", "crossed_with", "design") if key in entry and "covariate" in entry]
    if odd:
        raise ValueError(f"{odd[0]}: goes with a factor, not with a covariate")
    if crossed == factor:
        raise ValueError(f"crossed_with: {crossed!r} is the factor itself")
    if "crossed_levels" in entry and not crossed:
        raise ValueError("crossed_levels: needs crossed_with")
    model = entry.get("model", "")
    if model and model not in models:
        raise ValueError(f"model: {model!r} is no model of the study; {guess(model, [*models])}")
    quantity, of = _outcome(entry, layouts, events)
    rows, place = _place(entry, levels, (factor, crossed))
    levels_of, crossed_levels = (
        _levels(key, name, entry.get(given), rows) if name and "covariate" not in entry else ()
        for key, name, given in (("factor", factor, "levels"), ("crossed_with", crossed, "crossed_levels"))
    )
    if "covariate" in entry:
        _check_numbers(factor, rows)
    design = entry.get("design", "")
    if design == "within" and not _have_both(rows, factor, levels_of):
        raise ValueError(f"design: within, but no subject has both levels of {factor}")
    return Question(
        entry["name"], quantity, entry.get("curve", ""), of, factor, levels_of, crossed, crossed_levels,
        **place, design=design, model=model,
    )  # fmt: skip


def _outcome(
    entry: Mapping[str, Any], layouts: Collection[Layout], events: Collection[str] | None
) -> tuple[str, tuple[str, ...]]:
    """What is asked about, and whose."""
    if ("quantity" in entry) == ("curve" in entry):
        raise ValueError("expected one of quantity and curve")
    needed: tuple[str, ...] = ANGLE_OF
    known = {own.name: own for own in QUANTITIES}
    asked = entry.get("quantity", entry.get("curve", ""))
    if "quantity" in entry:
        if asked not in known:
            raise ValueError(f"quantity: {asked!r} is not measured; {guess(asked, [*known])}")
        needed = known[asked].of
    elif events is not None and asked not in events:
        raise ValueError(f"curve: the study has no event {asked!r}; {_known(asked, events)}")
    outcome = entry.get("quantity", "curve")
    wrong = [key for key in PARTS if (key in entry) != (key in needed)]
    if wrong:
        raise ValueError(f"{outcome}: expected the keys {' and '.join(needed)} to say whose, and no other of "
                         f"{', '.join(PARTS)}")  # fmt: skip
    digits = list(dict.fromkeys(digit for layout in layouts for digit in layout.digits))
    joints = [joint for layout in layouts for digit in layout.digits.values() for joint in digit.joints]
    joints += [joint.name for layout in layouts for joint in layout.solvable]
    names = {"joint": dict.fromkeys(joints), "angle": ANGLES, "digit": digits, "other_digit": digits}
    for key in needed:
        if key in names and entry[key] not in names[key]:
            raise ValueError(f"{key}: {entry[key]!r} is no {key.partition('_')[2] or key} of the study; "
                             f"{guess(entry[key], [*names[key]])}")  # fmt: skip
    if "measure" in needed and not re.fullmatch(MEASURE, entry["measure"]):
        raise ValueError(
            f"measure: {entry['measure']!r} is not measured; docs/keystrokes.md has the measures"
        )
    of = tuple(entry[key] for key in needed)
    if needed[-1:] == ("other_digit",):
        if of[0] == of[1]:
            raise ValueError(f"other_digit: is {of[1]!r} as digit is")
        of = tuple(sorted(of, key=digits.index))  # as the table has them
    return outcome, of


def _place(entry: Mapping[str, Any], levels: Levels, factors: Pair) -> tuple[Levels, dict[str, str]]:
    """Recordings that the question is about, and their hand and task: each named where there are several."""
    rows, place = list(levels), {"hand": "", "task": ""}
    for key in ("task", "hand"):
        known = list(dict.fromkeys(row[key] for row in rows))
        if key in factors:
            if key in entry:
                raise ValueError(f"{key}: is what the question compares; leave the key out")
            continue
        wanted = entry.get(key)
        hands = {(row["subject"], row["hand"]) for row in rows}
        if (
            wanted is None
            and len(known) > 1
            and not (key == "hand" and len(hands) == len({s for s, _ in hands}))
        ):
            raise ValueError(f"{key}: the study has {listed(known)}; say which one is meant")
        if wanted is not None and wanted not in known:
            raise ValueError(f"{key}: no evaluated recording is of {wanted!r}; {_known(wanted, known)}")
        place[key] = wanted or (known[0] if len(known) == 1 else "")
        rows = [row for row in rows if wanted in (None, row[key])]
    return rows, place


def _levels(key: str, factor: str, given: Sequence[str | int] | None, rows: Levels) -> Pair:
    known = list(dict.fromkeys(row[factor] for row in rows if row[factor]))
    levels = known if given is None else list(map(str, given))
    if odd := [level for level in levels if level not in known]:
        raise ValueError(f"levels: {odd[0]!r} is no level of {factor} here; {_known(odd[0], known)}")
    if len(levels) != 2:
        raise ValueError(f"{key}: {factor} has here the levels {listed(known)}; expected two, named in "
                         f"{'levels' if key == 'factor' else 'crossed_levels'}")  # fmt: skip
    return levels[0], levels[1]


def _check_numbers(covariate: str, rows: Levels) -> None:
    texts = list(dict.fromkeys(row[covariate] for row in rows if row[covariate]))
    for text in texts:
        if not is_number(text):
            raise ValueError(f"covariate: {covariate} has {text!r}; expected numbers, or ask with factor")
    if len(texts) < FEWEST_VALUES:
        raise ValueError(f"covariate: {covariate} has here {len(texts)} values; expected {FEWEST_VALUES} or "
                         "more, or ask with factor")  # fmt: skip


def is_number(text: str) -> bool:
    """Whether a cell holds a finite number."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _have_both(rows: Levels, factor: str, pair: Pair | tuple[()]) -> bool:
    having = [{row["subject"] for row in rows if row[factor] == level} for level in pair]
    return bool(set.intersection(*having))


def _known(word: str, known: Collection[str]) -> str:
    return guess(word, [*known]) if known else "it has none"
