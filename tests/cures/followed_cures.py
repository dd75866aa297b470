"""Do to a recording's file, mapping, layout or sheet what the sentence of a finding says, word for word."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from cures.brought_files import SECONDS, Brought, Result, check

from shukotsu.study.config_files import loaded_yaml

MOST_TIMES = 6

Follow = Callable[[re.Match[str], Brought, Brought], Brought]
"""Gives what is brought after the words found; the last is the faultless recording, for what only its
laboratory can look up.
"""


class NoSuchCureError(Exception):
    """The sentence says nothing that can be done to the letter."""


def obeyed(brought: Brought, right: Brought) -> tuple[Result, Result]:
    """Follow the first finding's sentence, look again, and so on until nothing new is found: first, last."""
    first = last = check(brought)
    done: set[str] = set()
    while (left := to_do(last)) and left[0] not in done and len(done) < MOST_TIMES:
        sentence = left[0]
        done.add(sentence)
        brought = followed(sentence, brought, right)
        last = check(brought)
    return first, last


def to_do(result: Result) -> list[str]:
    messages = [finding.message for finding in result.findings]
    return [message for message in messages if not re.search("nothing (more )?has to be done", message)]


def followed(sentence: str, brought: Brought, right: Brought) -> Brought:
    """Do what the sentence says. Raises NoSuchCureError where no rule reads it."""
    for pattern, follow in RULES:
        if words := re.search(pattern, sentence):
            return follow(words, brought, right)
    raise NoSuchCureError(sentence)


def _written(text: str) -> dict[str, Any]:
    """Read the text between backticks as YAML."""
    codes = re.findall("`([^`]+)`", text)
    return {key: value for code in codes for key, value in loaded_yaml(code, "a cure").items()}


def _in_mapping(brought: Brought, **keys: Any) -> Brought:
    if brought.mapping is None:
        raise NoSuchCureError(f"there is no mapping to write {keys} into")
    return replace(brought, mapping={**brought.mapping, **keys})


def _key(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return _in_mapping(brought, **_written(words[1]))


def _key_under(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    group = words[2]
    return _in_mapping(brought, **{group: {**(brought.mapping or {})[group], **_written(words[1])}})


def _fixed_axes(words: re.Match[str], brought: Brought, right: Brought) -> Brought:
    mapping = _key_under(words, brought, right).mapping or {}
    receivers = {
        name: {**each, "orientation": each["orientation"][::-1]}
        for name, each in mapping["receivers"].items()
    }
    return _in_mapping(brought, **{**mapping, "receivers": receivers})


def _not_in_step(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """The tracker's rate, which who owns it knows: that of new values."""
    csv = {**(brought.mapping or {})["csv"], **_written(words[1])}
    new = ~_repeats(brought.numbers(_worn(brought)[0]))
    interval_s = np.median(np.diff(brought.table[csv["time"]][new])) * SECONDS[csv["time_unit"]]
    return _in_mapping(brought, csv=csv, rate_hz=float(1 / interval_s))


def exchanged(names: Mapping[str, Any], pairs: Sequence[tuple[str, str]]) -> dict[str, Any]:
    other = dict(pairs) | {second: first for first, second in pairs}
    return {other.get(name, name): value for name, value in names.items()}


def _names(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    receivers = exchanged((brought.mapping or {})["receivers"], _pairs(words))
    return _in_mapping(brought, receivers=receivers)


def _pairs(words: re.Match[str]) -> list[tuple[str, str]]:
    return re.findall(r"(\w+) (?:and|with) (\w+)", words["pairs"])


def _added(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    late = float(words[1]) * (brought.table["frame"] >= int(words[2]))
    return brought.with_columns(time_s=brought.table["time_s"] + late)


def _names_in_file(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """In the file's column segment or, where it has stations, in the layout."""
    pairs = _pairs(words)
    if "segment" in brought.table:
        other = dict(pairs) | {second: first for first, second in pairs}
        return brought.with_columns(segment=np.array([other.get(n, n) for n in brought.table["segment"]]))
    segments = {name: dict(part) for name, part in brought.layout["segments"].items()}
    for first, second in pairs:
        numbers = segments[first]["receiver"], segments[second]["receiver"]
        segments[second]["receiver"], segments[first]["receiver"] = numbers
    return replace(brought, layout={**brought.layout, "segments": segments})


def _renamed(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    old, new = (part.split(", ") for part in (words[1], words[2]))
    done = brought.with_columns(**{title: brought.table[name] for name, title in zip(old, new, strict=True)})
    return _negated(words[3], done) if words[3] else done


def _negated(names: str, brought: Brought) -> Brought:
    return brought.with_columns(**{name: -brought.table[name] for name in re.findall(r"\w+_mm|q\w", names)})


def _negate(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return _negated(words[1], brought)


def _multiplied(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    names = re.findall(r"\w+_mm|time_s", words[1])
    if words[1] == "the times":
        names = [(brought.mapping or {})["csv"]["time"]] if brought.mapping else ["time_s"]
    return brought.with_columns(**{name: brought.table[name] * float(words[2]) for name in names})


def _in_place(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    new, old = (part.split(", ") for part in (words[1], words[2]))
    moved = {
        name: (-1.0 if taken.startswith("-") else 1.0) * brought.table[taken.lstrip("-")]
        for name, taken in zip(old, new, strict=True)
    }
    return brought.with_columns(**moved)


def _spiked(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """Frames as the file has them, counted from 0 where it has none."""
    for segment, frame in re.findall(r"(\w+) in frame (\d+)", words[1]):
        row = int(frame)
        if "frame" in brought.table:
            row = int(np.flatnonzero(brought.table["frame"][brought.rows(segment)] == row)[0])
        brought = brought.emptied(segment, [row])
    return brought


def _zeroed(_words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    """Every pose at 0, 0, 0 and not turned, as a quaternion 1 or as angles 0."""
    for segment in _worn(brought):
        numbers = brought.numbers(segment)
        brought = brought.emptied(segment, (numbers[:, :3] == 0).all(-1) & (np.abs(numbers).sum(-1) <= 1))
    return brought


def _worn(brought: Brought) -> list[str]:
    if brought.mapping is not None:
        return [*brought.mapping["receivers"]]
    return [name for name in brought.layout["segments"] if brought.rows(name).any()]


def _stuck(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    segment = words[1]
    return brought.emptied(segment, _repeats(brought.numbers(segment)))


def _repeats(numbers: Any) -> Any:
    return np.concatenate([[False], (numbers[1:] == numbers[:-1]).all(-1)])


def _rows_left_out(_words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    kept = np.ones(len(brought.table["frame"]), bool)
    for segment in _worn(brought):
        kept[brought.rows(segment)] = ~_repeats(brought.numbers(segment))
    return replace(brought, table={title: column[kept] for title, column in brought.table.items()})


def _in_layout(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    return replace(brought, layout={**brought.layout, **_written(words[1])})


def _under_segment(words: re.Match[str], brought: Brought, _: Brought) -> Brought:
    segments = brought.layout["segments"]
    changed = {**segments, words[2]: {**segments[words[2]], **_written(words[1])}}
    return replace(brought, layout={**brought.layout, "segments": changed})


def _in_sheet(column: str, value: str) -> Follow:
    return lambda _words, brought, _: replace(brought, sheet={**brought.sheet, column: value})


def _other_hand(words: re.Match[str], brought: Brought, right: Brought) -> Brought:
    """Which of the two it is, its laboratory knows."""
    if right.sheet["hand"] == words[1]:
        return replace(brought, sheet={**brought.sheet, "hand": words[1]})
    assert right.sheet["hand"] == words[2]
    if words[3].startswith("export it"):
        return right
    return _negated(words[3], brought)


def _looked_up(_words: re.Match[str], _brought: Brought, right: Brought) -> Brought:
    return right


RULES: Sequence[tuple[str, Follow]] = (
    (
        r"write (`axes: \w+`) under `(orientation)` in the mapping, and the columns of .* opposite",
        _fixed_axes,
    ),
    (r"write (`in_step: false`) under `csv` and the tracker's `rate_hz` in the mapping", _not_in_step),
    (r"write ((?:`[^`]+`(?: and )?)+) under `(\w+)` in the mapping", _key_under),
    (r"write (`[^`]+`) in the mapping", _key),
    (r"receivers (?P<pairs>.+) seem to be swapped.*exchange their names in `receivers` of the map", _names),
    (r"exchange these names in `receivers` of the mapping: (?P<pairs>.+)\.", _names),
    (
        r"receivers (?P<pairs>.+) seem to be swapped.*exchange their names in the file's column",
        _names_in_file,
    ),
    (r"exchange these names in the file's column .* in the layout: (?P<pairs>.+)\.", _names_in_file),
    (r"name the file's columns (.+) anew: ([^.]+?)(?:, and negate (.+))?\.$", _renamed),
    (r"; negate (.+) in the file", _negate),
    (r"add (\S+) s to all times from frame (\d+) on in the file", _added),
    (r"multiply (.+) by (\S+) in the file", _multiplied),
    (r"put (\S+_mm, \S+_mm, \S+_mm) in place of (.+) in the file", _in_place),
    (r"such as (.*?): .*leave the numbers of these poses empty in the file, and check again", _spiked),
    (r"where nothing can be, (.*?): .*leave the numbers of these poses empty in the file, and", _spiked),
    (r"0, 0, 0 and not turned.*leave the numbers of these poses empty in the file", _zeroed),
    (r"The receiver (\w+) .*leave its numbers empty in the file where they repeat those before", _stuck),
    (r"leave the rows out of the file that repeat those of the frame before", _rows_left_out),
    (r"write (`[^`]+`) under the segment (\w+) in the layout", _under_segment),
    (r"write (`[^`]+`) in the layout", _in_layout),
    (r"write `repair` in the column hemisphere of the recordings sheet", _in_sheet("hemisphere", "repair")),
    (
        r"write `(\w+)` in the column hand of the recordings sheet .*, or, if it is a (\w+) hand and the "
        r"file mirrored, (.+)\.",
        _other_hand,
    ),
    (r"give a reason under `exclude` in the recordings sheet", _in_sheet("exclude", "too short")),
    (r"name the right ones in the mapping|put the right ones into the file", _looked_up),
    (r"name each one's own columns or `value` in the mapping", _looked_up),
    (r"export the file again, each receiver with numbers of its own", _looked_up),
)
"""By the words of a sentence, as one expression: what is done."""
