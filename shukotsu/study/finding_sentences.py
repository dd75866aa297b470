"""The sentences of findings, made where they are shown: of a kind, its variant and its values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from shukotsu.translation import N_, Template, filled, foreign, listed, ngettext, plural, tr, word

Values = Mapping[str, Any]
"""By name: numbers, words, or lists of them, as JSON has them."""


class Keys(NamedTuple):
    """Keys with their values that are to be written into the mapping; under : the key that they belong to."""

    written: tuple[str, ...]
    under: str = ""


class Mistake(NamedTuple):
    """What is seen and probably is; what to do; what to do where the recording came without a mapping."""

    what: str
    cure: str | Keys
    table_cure: str = ""


_REPAIR = N_("write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)")
_NOTHING = N_("nothing has to be done")
_GAP = N_(
    "nothing has to be done, but no speed and no cycle is right there, and times after it do not compare "
    "with those before"
)
_ADD = N_("add {by} s to all times from frame {number} on in the file")
_EMPTY = N_("leave the numbers of these poses empty in the file, and check again")
_REST = N_("record again where the {percent:.0f} % that are left do not suffice")
_TIMES = N_("multiply the times by {factor:g} in the file")
_SHEET = N_("correct the column subject or file of the recordings sheet, or give a reason under `exclude`")
_EXCHANGE = N_("exchange these names in `receivers` of the mapping: {exchanged}")
_EXCHANGE_IN_FILE = N_(
    "exchange these names in the file's column segment or, where the file has stations, their station "
    "numbers in the layout: {exchanged}"
)
_IN_PLACE = N_("put {millimetres} in place of x_mm, y_mm, z_mm in the file")
_UNIT = N_("the positions seem to be in {true} and are read as {read}, a factor of {factor:.4g} off")
_ANOTHER_TIME = N_(
    "the times, read as {read}, make {rate_hz:.3g} frames a second, and seem to be in another unit"
)
_PAUSE = N_(
    "the clock jumps in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such jumps: {steps}): a pause, a "
    "new start of the tracker, or a clock that was set"
)
_FULL = N_(
    "the clock goes back in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such jumps: {steps}): "
    "midnight, or a counter that was full and began again"
)

MISTAKES: Mapping[str, Mistake] = {
    "quaternion-order/order": Mistake(
        N_("the quaternions are read as {read} and seem to be {true}"),
        Keys(("order: {order}",), "orientation"),
        N_("name the file's columns qw, qx, qy, qz anew: qx, qy, qz, qw"),
    ),
    "quaternion-order/inverse-too": Mistake(
        N_("the quaternions seem to be {true} of the inverse rotation"),
        Keys(("order: {order}", "rotates: {rotates}"), "orientation"),
        N_("name the file's columns qw, qx, qy, qz anew: qx, qy, qz, qw, and negate qx, qy and qz"),
    ),
    "quaternion-inverse": Mistake(
        N_("the rotations seem to be the inverse of what is declared"),
        Keys(("rotates: {rotates}",), "orientation"),
        N_("negate qx, qy and qz in the file"),
    ),
    "euler-order/axes": Mistake(
        N_("the angles are read as {read} and seem to be {true}"), Keys(("axes: {true}",), "orientation")
    ),
    "euler-order/fixed": Mistake(
        N_("the angles are read as {read} about turning axes and seem to be about fixed ones"),
        N_(
            "write `axes: {true}` under `orientation` in the mapping, and the columns of each receiver's "
            "`orientation` in the opposite order"
        ),
    ),
    "units/positions-small": Mistake(
        _UNIT,
        Keys(("position_unit: {true}",)),
        N_("multiply x_mm, y_mm and z_mm by {factor:g} in the file"),
    ),
    "units/positions-large": Mistake(_UNIT, Keys(("position_unit: {true}",))),
    "units/radians": Mistake(
        N_("the angles are read as degrees and seem to be radians"), Keys(("unit: rad",), "orientation")
    ),
    "units/degrees": Mistake(
        N_("the receivers turn at {speed_rad_s:.0f} rad/s: the angles, read as radians, seem to be degrees"),
        Keys(("unit: deg",), "orientation"),
    ),
    "time-unit": Mistake(_ANOTHER_TIME, Keys(("time_unit: {unit}",), "csv"), _TIMES),
    "time-unit/scaled": Mistake(_ANOTHER_TIME, _TIMES),
    "time-unit/rate": Mistake(
        N_(
            "the times make {rate_hz:.3g} frames a second, as `rate_hz` says, and there seem to be "
            "{true_hz:.3g}"
        ),
        Keys(("rate_hz: {true_hz:g}",)),
    ),
    "clock/ahead": Mistake(_PAUSE, _GAP),
    "clock/back": Mistake(_PAUSE, _GAP),
    "clock/midnight": Mistake(_FULL, _ADD),
    "clock/wrap": Mistake(_FULL, _ADD),
    "clock/still": Mistake(
        N_(
            "the clock stands still at {from_s:.6g} s for {rows} frames, from frame {number} on (such "
            "places: {steps})"
        ),
        _GAP,
    ),
    "hemisphere/jumps": Mistake(
        N_(
            "the position of {segment} jumps to the other side of the transmitter, first {at} (jumps: "
            "{count}; other receivers that jump: {others}): the tracker took the wrong hemisphere"
        ),
        _REPAIR,
    ),
    "hemisphere/all-along": Mistake(
        N_("receivers seem to be on the other side of the transmitter all along: {segments}"), _REPAIR
    ),
    "hemisphere/whole": Mistake(
        N_("all receivers seem to be on the other side of the transmitter all along"), _REPAIR
    ),
    "hemisphere/left-out": Mistake(
        N_(
            "poses on the other side of the transmitter are left out ({which}): the tracker took the wrong "
            "hemisphere"
        ),
        _REPAIR,
    ),
    "hemisphere/between": Mistake(
        N_(
            "poses between the two sides of the transmitter are left out ({which}): the tracker's filter "
            "smears a jump"
        ),
        _NOTHING,
    ),
    "hemisphere/put-back": Mistake(
        N_("poses on the other side of the transmitter were put back, as was asked for ({which})"), _NOTHING
    ),
    "hemisphere/undecided": Mistake(
        N_(
            "poses are of a receiver that was on both sides of the transmitter, or on another than its "
            "neighbours, and nothing tells which is right ({which}); they are kept as recorded"
        ),
        N_("leave the numbers of those on the wrong side empty in the file, and check again"),
    ),
    "receiver-stuck/repeated": Mistake(
        N_(
            "in {percent:.0f} % of the frames every receiver stands as in the frame before: probably the "
            "program repeats the last values"
        ),
        N_("write `in_step: false` under `csv` and the tracker's `rate_hz` in the mapping"),
        N_("leave the rows out of the file that repeat those of the frame before"),
    ),
    "receiver-stuck/at-times": Mistake(
        N_(
            "the receiver {segment} gives one and the same pose in {percent:.0f} % of its frames, first "
            "{at}, while others move: probably its channel hung"
        ),
        N_("leave its numbers empty in the file where they repeat those before"),
    ),
    "receiver-stuck/all-along": Mistake(
        N_(
            "the receiver {segment} gives one and the same pose all along while others move, and is not "
            "used: probably its channel hung"
        ),
        N_("check its plug, and record again"),
    ),
    "sudden-change/one": Mistake(
        N_(
            "the receiver {segment} is not where its neighbours say, first {at} and for good: probably it "
            "fell off, and its poses from then on are left out"
        ),
        _REST,
    ),
    "sudden-change/until": Mistake(
        N_(
            "the receiver {segment} is where its neighbours say, first {at} and for good: probably it was "
            "not on before, and its poses until then are left out"
        ),
        _REST,
    ),
    "sudden-change/all": Mistake(
        N_(
            "the receivers are {grown:.3g} times as far from each other as before, first {at} and for good: "
            "probably a unit or the order of numbers changes in the file, and the poses from then on are "
            "left out"
        ),
        N_("export the recording again, all of it alike"),
    ),
    "spikes/some": Mistake(
        N_(
            "poses are where nothing can be (number: {count}), such as {spiked}: probably the tracker's "
            "field was disturbed or a row is damaged"
        ),
        _EMPTY,
    ),
    "spikes/left-out": Mistake(
        N_(
            "poses are where nothing can be, and are left out ({which}): the tracker's field was probably "
            "disturbed"
        ),
        N_("look for metal or a motor near the transmitter"),
    ),
    "spikes/all": Mistake(
        N_(
            "the poses jump about from frame to frame as no body moves, and no joint closes: these are "
            "probably not the columns of positions and orientations"
        ),
        N_("name the right ones in the mapping"),
        N_("put the right ones into the file"),
    ),
    "receivers-swapped": Mistake(
        N_("the receivers {segment} and {segment_2} seem to be swapped"), _EXCHANGE, _EXCHANGE_IN_FILE
    ),
    "digits-swapped/two": Mistake(
        N_("the {digit} and the {digit_2} finger seem to be swapped"), _EXCHANGE, _EXCHANGE_IN_FILE
    ),
    "digits-swapped/reversed": Mistake(
        N_("the fingers seem to be named in the opposite order"), _EXCHANGE, _EXCHANGE_IN_FILE
    ),
    "wrong-hand": Mistake(
        N_("this seems to be a {hand} hand"),
        N_(
            "write `{code}` in the column hand of the recordings sheet (or --hand {code}), or, if it is a "
            "{hand_2} hand and the file mirrored, export it from a right-handed frame"
        ),
        N_(
            "write `{code}` in the column hand of the recordings sheet (or --hand {code}), or, if it is a "
            "{hand_2} hand and the file mirrored, negate y_mm, qx and qz in it"
        ),
    ),
    "axes-mirrored/negated": Mistake(
        N_("the positions seem to be negated along {negated}"),
        Keys(("position_axes: [{columns}]",)),
        _IN_PLACE,
    ),
    "axes-mirrored/exchanged": Mistake(
        N_("the x, y, z of the rotations' frame seem to be {columns} of the positions"),
        Keys(("position_axes: [{columns}]",)),
        _IN_PLACE,
    ),
    "receiver-turned/all": Mistake(
        N_("all receivers seem to be turned on their bones by {how}"),
        N_("write `receiver_axes: {receiver_axes}` in the layout"),
    ),
    "receiver-turned/one": Mistake(
        N_("the receiver {segment} seems to be turned on its bone by {how}"),
        N_("write `receiver_axes: {receiver_axes}` under the segment {code} in the layout"),
    ),
    "other-person/another": Mistake(
        N_(
            "the hand is {scale:.2f} times the average size and its bones are of other lengths than in "
            "another recording ({other}: {usual:.2f} times): probably this is another person"
        ),
        _SHEET,
    ),
    "other-person/put-on-anew": Mistake(
        N_(
            "the receivers sit elsewhere on the bones than in another recording ({other}), and the bones are "
            "about as long: probably they were put on anew"
        ),
        N_("give this recording a session of its own in the column session of the recordings sheet"),
    ),
    "same-file": Mistake(
        N_("all poses are, number by number, those of {other}: probably one file is named twice"), _SHEET
    ),
    "too-short": Mistake(
        N_(
            "the recording has {length}, too short for a joint to show how it moves: probably it was "
            "stopped at once or the file is cut off"
        ),
        N_("record it again, or give a reason under `exclude` in the recordings sheet"),
    ),
    "zeros": Mistake(
        N_(
            "poses, most of {segment}, first {at}, are at 0, 0, 0 and not turned, to the last bit (number: "
            "{count}): probably the program writes zeros where it has no value"
        ),
        _EMPTY,
    ),
    "unchecked": Mistake(
        N_("the recording could not be checked: {reason}"), N_("whatever is shown of it rests on no check")
    ),
    "receivers-alike": Mistake(
        N_(
            "the receivers {segment} and {segment_2} have one and the same pose in {percent:.0f} % of their "
            "frames, first {at}, which two receivers cannot: probably one is read, or was exported, in "
            "place of the other"
        ),
        N_("name each one's own columns or `value` in the mapping, or export the file again"),
        N_("export the file again, each receiver with numbers of its own"),
    ),
}
"""By kind of docs/mistakes.md and variant; cures are to be followed word for word."""

EVIDENCE: Mapping[str, str] = {
    "scale": N_("the hand comes out {before:.2g} times the average size, put right {after:.2g} times"),
    "reach": N_("joints come out {before:.2g} mm from the receivers, put right {after:.0f} mm"),
    "gap": N_("put right, the gap of {joint} falls from {before:.1f} to {after:.1f} mm"),
    "place": N_("{joint} is {before:.0f} mm from where an average hand has it, put right {after:.0f} mm"),
    "turn": N_(
        "the {angle} of {joint} is {least:.0f} to {most:.0f} deg, put right {least_after:.0f} to "
        "{most_after:.0f} deg"
    ),
}
"""By what is seen, `seen` among the values: what undoing a mistake changes most."""

_SIZES = ("scale", "reach")

_EFFECT = N_(
    "put right, the median gap of the joints concerned goes from {gap_before_mm:.1f} to {gap_after_mm:.1f} "
    "mm, and {moved} of {joints} centres move by more than 2 mm"
)
"""Where `effect` is among the values: how much it matters."""

PROBLEMS: Mapping[str, Template] = {
    "recording/no-pose": N_("no usable pose of {segments}; check that receiver"),
    "hand/uncalibrated": N_("no recording calibrates this hand, so none of its joints could be solved"),
    "knuckles-too-close": N_(
        "{joints} lie {mm:.1f} mm apart, nearer than in any hand: look at the receivers on these fingers"
    ),
    "field-disturbed": plural(
        "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: {n} receiver is off by up "
        "to {mm:.1f} mm and {deg:.0f} deg there ({segments}); {percent:.0f} % of its frames were left out",
        "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: {n} receivers are off by "
        "up to {mm:.1f} mm and {deg:.0f} deg there ({segments}); {percent:.0f} % of a receiver's frames, at "
        "the most, were left out",
    ),
}
"""Sentences of problems that are no mistake in what was declared of a recording."""


def key_of(kind: str, variant: str) -> str:
    """Return the name of a kind's variant in the tables of this module."""
    return f"{kind}/{variant}" if variant else kind


def sentence_of(kind: str, variant: str, values: Values, accepted: str = "") -> str:
    """Return a problem's sentence: of a mistake what is seen, what shows it, what to do and why it may stand;
    another's by its kind, or the text in its values.
    """
    key = key_of(kind, variant)
    if key in MISTAKES:
        what, evidence = what_of(kind, variant, values), evidence_of(values)
        return what_and_cure(f"{what} ({evidence})" if evidence else what, kind, variant, values, accepted)
    if key in PROBLEMS:
        return filled(PROBLEMS[key], {"n": values.get("count", 1), **values})
    named = f"{word(values['segment'])}: " if "segment" in values else ""
    return named + foreign(str(values.get("text", "")))


def what_and_cure(what: str, kind: str, variant: str, values: Values, accepted: str) -> str:
    """Join a mistake and its cure in a sentence; without `what` the cure alone. accepted : the reason, if
    there is any, to let it stand.
    """
    cure = cure_of(kind, variant, values)
    text = tr("{what}; {cure}", what=what, cure=cure) if what else cure[0].upper() + cure[1:]
    sentence = tr("{text}.", text=text)
    return tr("{finding} Accepted: {reason}", finding=sentence, reason=accepted) if accepted else sentence


def in_quotes(text: str) -> str:
    """Return text for a terminal: what is to be written stands in quotes, not in backticks."""
    return text.replace("`", '"')


def what_of(kind: str, variant: str, values: Values) -> str:
    """Describe what is seen and what it probably is, as a sentence begins."""
    text = tr(MISTAKES[key_of(kind, variant)].what, **_placeholders(values))
    return text[0].upper() + text[1:]


def cure_of(kind: str, variant: str, values: Values) -> str:
    """Return the cure in words."""
    mistake, placeholders = MISTAKES[key_of(kind, variant)], _placeholders(values)
    cure = mistake.table_cure if values.get("unmapped") and mistake.table_cure else mistake.cure
    if isinstance(cure, str):
        return tr(cure, **placeholders)
    written = listed(f"`{key.format(**placeholders)}`" for key in cure.written)
    if cure.under:
        return tr("write {written} under `{key}` in the mapping", written=written, key=cure.under)
    return tr("write {written} in the mapping", written=written)


def evidence_of(values: Values) -> str:
    """Describe what undoing the mistake changes, and how much it matters; empty where poses alone show it."""
    placeholders, seen = _placeholders(values), values.get("seen", "")
    evidence = [tr(EVIDENCE[seen], **placeholders)] if seen else []
    if (
        "effect" in values and seen not in _SIZES
    ):  # where a size was absurd, a gap in millimetres says nothing
        evidence.append(tr(_EFFECT, **placeholders))
    return "; ".join(evidence)


def _placeholders(values: Values) -> dict[str, Any]:
    """Return the values, and the phrases that are made of several of them."""
    phrases: dict[str, Any] = {"others": 0, **values}
    if "first_s" in values:
        phrases["at"] = tr("at {time_s:.2f} s", time_s=values["first_s"])
    elif "first_row" in values:
        phrases["at"] = tr("in row {row} of its rows", row=values["first_row"])
    if "counts" in values:
        counts = zip(values["counts"], values["of"], strict=True)
        phrases["which"] = tr(", ").join(f"{word(name)}: {n}" for n, name in counts)
    if "negated" in values:
        phrases["negated"] = listed(values["negated"])
    if "spiked" in values:
        phrases["spiked"] = tr(", ").join(
            tr("{segment} in frame {n}", segment=segment, n=frame) + "".join(f" ({s:.2f} s)" for s in time_s)
            for segment, frame, *time_s in values["spiked"]
        )
    pairs = values.get("pairs", [])
    if "segment_2" in values:
        pairs = [(values["segment"], values["segment_2"])]
    phrases["exchanged"] = ", ".join(tr("{code} with {code_2}", code=a, code_2=b) for a, b in pairs)
    if "columns" in values:
        phrases["millimetres"] = ", ".join(f"{axis}_mm" for axis in values["columns"].split(", "))
    if "frames" in values:
        duration = f" ({values['duration_s']:.2g} s)" if "duration_s" in values else ""
        phrases["length"] = ngettext("{n} frame", "{n} frames", values["frames"]) + duration
    if "turn_deg" in values:
        about = (
            N_("{deg} deg about its {axis} axis") if values["turn_axis"] else N_("{deg} deg about a diagonal")
        )
        phrases["how"] = tr(about, deg=values["turn_deg"], axis=values["turn_axis"])
        axes = (f"{name}: {values[name]}" for name in ("distal", "lateral", "dorsal"))
        phrases["receiver_axes"] = f"{{{', '.join(axes)}}}"
    if "task" in values:
        person = tr("subject {subject}", subject=values["subject"]) if values["subject"] else ""
        person += tr(", session {session}", session=values["session"]) if values["session"] else ""
        hand = tr("{hand} hand", hand=values["hand"])
        phrases["other"] = tr(", ").join(filter(None, (person, hand, values["task"])))
    # what is to be written into a file stays as it is, whatever the language
    phrases["code"] = values.get("segment", values.get("hand", ""))
    return phrases
