"""The sentences of findings, made where they are shown: of a kind, its variant and its values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shukotsu.sentences.translation import N_, Template, filled, foreign, listed, ngettext, plural, tr, word

Values = Mapping[str, Any]
"""By name: numbers, words, or lists of them, as JSON has them."""

WHAT: Mapping[str, Template] = {
    "quaternion-order/order": N_("the quaternions are read as {read} and seem to be {true}"),
    "quaternion-order/inverse-too": N_("the quaternions seem to be {true} of the inverse rotation"),
    "quaternion-inverse": N_("the rotations seem to be the inverse of what is declared"),
    "euler-order/axes": N_("the angles are read as {read} and seem to be {true}"),
    "euler-order/fixed": N_(
        "the angles are read as {read} about turning axes and seem to be about fixed ones"
    ),
    "units/positions-small": N_(
        "the positions are {factor:.4g} times too small, in {true} and read as {read}"
    ),
    "units/positions-large": N_(
        "the positions are {factor:.4g} times too large, in {true} and read as {read}"
    ),
    "units/radians": N_("the angles are read as degrees and seem to be radians"),
    "units/degrees": N_(
        "the receivers turn at {speed_rad_s:.0f} rad/s: the angles seem to be degrees and are read as radians"
    ),
    "time-unit": N_(
        "the times make {rate_hz:.3g} frames a second: they seem to be in {unit} and are read as {read}"
    ),
    "time-unit/scaled": N_(
        "the times make {rate_hz:.3g} frames a second: they seem to be in another unit than {read}"
    ),
    "time-unit/rate": N_(
        "the times make {rate_hz:.3g} frames a second, as `rate_hz` says, and there seem to be {true_hz:.3g}"
    ),
    "clock/ahead": N_(
        "the clock jumps ahead by {by_s:.6g} s in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such "
        "jumps: {steps}): nothing was recorded in between, or it was set"
    ),
    "clock/back": N_(
        "the clock goes back by {by_s:.6g} s in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such "
        "jumps: {steps}): probably the tracker was started again, or its clock was set"
    ),
    "clock/midnight": N_(
        "the clock goes back by a day in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such jumps: "
        "{steps}): it passed midnight"
    ),
    "clock/wrap": N_(
        "the clock goes back by {by} s in frame {number}, from {from_s:.6g} to {to_s:.6g} s (such jumps: "
        "{steps}): probably its counter was full and began again"
    ),
    "clock/still": N_(
        "the clock stands still at {from_s:.6g} s for {rows} frames, from frame {number} on (such places: "
        "{steps})"
    ),
    "hemisphere/jumps": plural(
        "the position of {segment} jumps to the other side of the transmitter {n} time, first {at}{also}: "
        "the tracker took the wrong hemisphere",
        "the position of {segment} jumps to the other side of the transmitter {count} times, first "
        "{at}{also}: the tracker took the wrong hemisphere",
    ),
    "hemisphere/all-along": plural(
        "the receiver {segments} seems to be on the other side of the transmitter all along",
        "the receivers {segments} seem to be on the other side of the transmitter all along",
    ),
    "hemisphere/whole": N_("all receivers seem to be on the other side of the transmitter all along"),
    "hemisphere/left-out": plural(
        "one pose, of {segment}, is on the other side of the transmitter and left out: the tracker took the "
        "wrong hemisphere",
        "{count} poses ({which}) are on the other side of the transmitter and left out: the tracker took the "
        "wrong hemisphere",
    ),
    "hemisphere/between": N_(
        "{count} poses ({which}) are between the two sides of the transmitter, where the tracker's filter "
        "smears a jump, and left out"
    ),
    "hemisphere/put-back": N_(
        "{count} poses ({which}) were put back from the other side of the transmitter, as was asked for"
    ),
    "hemisphere/undecided": N_(
        "{count} poses ({which}) are of a receiver that was on both sides of the transmitter, or on another "
        "than its neighbours, and nothing tells which is right; they are kept as recorded"
    ),
    "receiver-stuck/repeated": N_(
        "in {percent:.0f} % of the frames every receiver stands as in the frame before: probably the program "
        "repeats the last values"
    ),
    "receiver-stuck/at-times": N_(
        "the receiver {segment} gives one and the same pose in {percent:.0f} % of its frames, first {at}, "
        "while others move: probably its channel hung"
    ),
    "receiver-stuck/all-along": N_(
        "the receiver {segment} gives one and the same pose all along while others move, and is not used: "
        "probably its channel hung"
    ),
    "sudden-change/one": N_(
        "the receiver {segment} is not where its neighbours say, first {at} and for good: probably it fell "
        "off, and its poses from then on are left out"
    ),
    "sudden-change/until": N_(
        "the receiver {segment} is where its neighbours say, first {at} and for good: probably it was not on "
        "before, and its poses until then are left out"
    ),
    "sudden-change/all": N_(
        "the receivers are {grown:.3g} times as far from each other as before, first {at} and for good: "
        "probably a unit or the order of numbers changes in the file, and the poses from then on are left out"
    ),
    "spikes/some": plural(
        "one pose is where nothing can be, {spiked}: probably the tracker's field was disturbed or a row is "
        "damaged",
        "{count} poses are where nothing can be, such as {spiked}: probably the tracker's field was "
        "disturbed or a row is damaged",
    ),
    "spikes/left-out": plural(
        "one pose, of {segment}, is where nothing can be and left out: the tracker's field was probably "
        "disturbed",
        "{count} poses ({which}) are where nothing can be and left out: the tracker's field was probably "
        "disturbed",
    ),
    "spikes/all": N_(
        "the poses jump about from frame to frame as no body moves, and no joint closes: these are probably "
        "not the columns of positions and orientations"
    ),
    "receivers-swapped": N_("the receivers {segment} and {segment_2} seem to be swapped"),
    "digits-swapped/two": N_("the {digit} and the {digit_2} finger seem to be swapped"),
    "digits-swapped/reversed": N_("the fingers seem to be named in the opposite order"),
    "wrong-hand": N_("this seems to be a {hand} hand"),
    "axes-mirrored/negated": plural(
        "the positions' {negated} seems to be negated",
        "the positions' {negated} seem to be negated",
    ),
    "axes-mirrored/exchanged": N_(
        "the x, y, z of the rotations' frame seem to be {columns} of the positions"
    ),
    "receiver-turned/all": N_("all receivers seem to be turned on their bones by {how}"),
    "receiver-turned/one": N_("the receiver {segment} seems to be turned on its bone by {how}"),
    "other-person/another": N_(
        "the hand is {scale:.2f} times the average size and its bones are of other lengths than in {other} "
        "({usual:.2f} times): probably this is another person"
    ),
    "other-person/put-on-anew": N_(
        "the receivers sit elsewhere on the bones than in {other}, and the bones are about as long: probably "
        "they were put on anew"
    ),
    "same-file": N_("all poses are, number by number, those of {other}: probably one file is named twice"),
    "too-short": N_(
        "the recording has {length}, too short for a joint to show how it moves: probably it was stopped at "
        "once or the file is cut off"
    ),
    "zeros": plural(
        "one pose, of {segment}, first {at}, is at 0, 0, 0 and not turned, to the last bit: probably the "
        "program writes zeros where it has no value",
        "{count} poses, most of {segment}, first {at}, are at 0, 0, 0 and not turned, to the last bit: "
        "probably the program writes zeros where it has no value",
    ),
    "unchecked": N_("the recording could not be checked: {reason}"),
    "receivers-alike": N_(
        "the receivers {segment} and {segment_2} have one and the same pose in {percent:.0f} % of their "
        "frames, first {at}, which two receivers cannot: probably one is read, or was exported, in place of "
        "the other"
    ),
}
"""What is seen, and what it probably is, by kind of docs/mistakes.md and variant."""

_NOT_COMPARED = N_(
    "nothing has to be done: speeds and cycles have a gap there, and times after it do not compare with "
    "those before"
)
_ADD = N_(
    "add {by} s to all times from frame {number} on in the file, or speeds and cycles have a gap there and "
    "times after it do not compare with those before"
)

CURES: Mapping[str, str] = {
    "quaternion-order/order": N_("write `order: {order}` under `orientation` in the mapping"),
    "quaternion-order/inverse-too": N_(
        "write `order: {order}` and `rotates: {rotates}` under `orientation` in the mapping"
    ),
    "quaternion-inverse": N_("write `rotates: {rotates}` under `orientation` in the mapping"),
    "euler-order/axes": N_("write `axes: {true}` under `orientation` in the mapping"),
    "euler-order/fixed": N_(
        "write `axes: {true}` under `orientation` in the mapping, and the columns of each receiver's "
        "`orientation` in the opposite order"
    ),
    "units/positions-small": N_("write `position_unit: {true}` in the mapping"),
    "units/positions-large": N_("write `position_unit: {true}` in the mapping"),
    "units/radians": N_("write `unit: rad` under `orientation` in the mapping"),
    "units/degrees": N_("write `unit: deg` under `orientation` in the mapping"),
    "time-unit": N_("write `time_unit: {unit}` under `csv` in the mapping"),
    "time-unit/scaled": N_("multiply the times by {factor:g} in the file"),
    "time-unit/rate": N_("write `rate_hz: {true_hz:g}` in the mapping"),
    "clock/ahead": _NOT_COMPARED,
    "clock/back": _NOT_COMPARED,
    "clock/midnight": _ADD,
    "clock/wrap": _ADD,
    "clock/still": N_("nothing has to be done, but of these frames no speed and no cycle can be right"),
    "hemisphere/jumps": N_(
        "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)"
    ),
    "hemisphere/all-along": N_(
        "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)"
    ),
    "hemisphere/whole": N_(
        "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)"
    ),
    "hemisphere/left-out": N_(
        "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere) to put "
        "them back"
    ),
    "hemisphere/between": N_("nothing has to be done"),
    "hemisphere/put-back": N_("nothing more has to be done"),
    "hemisphere/undecided": N_(
        "leave the numbers of these poses empty in the file where they are on the wrong side, or give a "
        "reason under `exclude` in the recordings sheet"
    ),
    "receiver-stuck/repeated": N_(
        "write `in_step: false` under `csv` and the tracker's `rate_hz` in the mapping"
    ),
    "receiver-stuck/at-times": N_(
        "leave its numbers empty in the file where they repeat those before, or leave the recording out with "
        "`exclude` in the recordings sheet"
    ),
    "receiver-stuck/all-along": N_("check its plug, and record again"),
    "sudden-change/one": N_("fix it and record again where the {percent:.0f} % that are left do not suffice"),
    "sudden-change/until": N_("record again where the {percent:.0f} % that are left do not suffice"),
    "sudden-change/all": N_("export the recording again, all of it alike"),
    "spikes/some": N_("leave the numbers of these poses empty in the file, and check again"),
    "spikes/left-out": N_("look for metal or a motor near the transmitter"),
    "spikes/all": N_("name the right ones in the mapping"),
    "receivers-swapped": N_("exchange their names in `receivers` of the mapping"),
    "digits-swapped/two": N_("exchange these names in `receivers` of the mapping: {exchanged}"),
    "digits-swapped/reversed": N_("exchange these names in `receivers` of the mapping: {exchanged}"),
    "wrong-hand": N_(
        "write `{code}` in the column hand of the recordings sheet (or --hand {code}), or, if it is a "
        "{hand_2} hand and the file mirrored, export it from a right-handed frame"
    ),
    "axes-mirrored/negated": N_("write `position_axes: [{columns}]` in the mapping"),
    "axes-mirrored/exchanged": N_("write `position_axes: [{columns}]` in the mapping"),
    "receiver-turned/all": N_("write `receiver_axes: {receiver_axes}` in the layout"),
    "receiver-turned/one": N_(
        "write `receiver_axes: {receiver_axes}` under the segment {code} in the layout"
    ),
    "other-person/another": N_("correct the column subject or file of the recordings sheet"),
    "other-person/put-on-anew": N_(
        "give this recording a session of its own in the column session of the recordings sheet"
    ),
    "same-file": N_(
        "correct the column file of the recordings sheet, or give a reason under `exclude` for one of the two"
    ),
    "too-short": N_("record it again, or give a reason under `exclude` in the recordings sheet"),
    "zeros": N_("leave the numbers of these poses empty in the file"),
    "unchecked": N_("whatever is shown of it rests on no check"),
    "receivers-alike": N_("name each one's own columns or `value` in the mapping, or export the file again"),
}
"""What to do, word for word."""

TABLE_CURES: Mapping[str, str] = {
    "quaternion-order/order": N_("name the file's columns qw, qx, qy, qz anew: qx, qy, qz, qw"),
    "quaternion-order/inverse-too": N_(
        "name the file's columns qw, qx, qy, qz anew: qx, qy, qz, qw, and negate qx, qy and qz"
    ),
    "quaternion-inverse": N_("negate qx, qy and qz in the file"),
    "units/positions-small": N_("multiply x_mm, y_mm and z_mm by {factor:g} in the file"),
    "time-unit": N_("multiply time_s by {factor:g} in the file"),
    "receiver-stuck/repeated": N_("leave the rows out of the file that repeat those of the frame before"),
    "spikes/all": N_("put the right ones into the file"),
    "receivers-swapped": N_(
        "exchange their names in the file's column segment or, where the file has stations, their station "
        "numbers in the layout"
    ),
    "digits-swapped/two": N_(
        "exchange these names in the file's column segment or, where the file has stations, their station "
        "numbers in the layout: {exchanged}"
    ),
    "digits-swapped/reversed": N_(
        "exchange these names in the file's column segment or, where the file has stations, their station "
        "numbers in the layout: {exchanged}"
    ),
    "wrong-hand": N_(
        "write `{code}` in the column hand of the recordings sheet (or --hand {code}), or, if it is a "
        "{hand_2} hand and the file mirrored, negate y_mm, qx and qz in it"
    ),
    "axes-mirrored/negated": N_("put {millimetres} in place of x_mm, y_mm, z_mm in the file"),
    "axes-mirrored/exchanged": N_("put {millimetres} in place of x_mm, y_mm, z_mm in the file"),
    "receivers-alike": N_("export the file again, each receiver with numbers of its own"),
}
"""What to do where the recording came without a mapping, `unmapped` among the values."""

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

EFFECTS: Mapping[str, str] = {
    "closer": N_(
        "the median gap of the joints concerned falls from {gap_before_mm:.1f} to {gap_after_mm:.1f} mm, "
        "centres that move by more than 2 mm: {moved} of {joints}"
    ),
    "no-closer": N_(
        "the joints concerned close as they did, with a median gap of {gap_before_mm:.1f} and "
        "{gap_after_mm:.1f} mm, centres that move by more than 2 mm: {moved} of {joints}"
    ),
    "none": N_(
        "no joint closes better and no centre moves by more than 2 mm, so nothing measurable is gained"
    ),
}
"""By `effect` among the values: how much it matters."""


def key_of(kind: str, variant: str) -> str:
    """Return the name of a kind's variant in the tables of this module."""
    return f"{kind}/{variant}" if variant else kind


def whole_sentence(kind: str, variant: str, values: Values, accepted: str = "") -> str:
    """Say a whole finding: what is seen, what shows it, what to do; accepted : why it may stand."""
    what, evidence, cure = what_of(kind, variant, values), evidence_of(values), cure_of(kind, variant, values)
    if not evidence:
        return accepted_text(what_and_cure(what, cure), accepted)
    template = N_("{what}: {evidence}; {cure}.") if "seen" in values else N_("{what} ({evidence}); {cure}.")
    return accepted_text(tr(template, what=what, evidence=evidence, cure=cure), accepted)


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


def sentence_of(kind: str, variant: str, values: Values, accepted: str = "") -> str:
    """Return a problem's sentence: a finding's whole, another's by its kind, or the text in its values."""
    key = key_of(kind, variant)
    if key in WHAT:
        return whole_sentence(kind, variant, values, accepted)
    if key in PROBLEMS:
        return filled(PROBLEMS[key], {"n": values.get("count", 1), **values})
    named = f"{word(values['segment'])}: " if "segment" in values else ""
    return named + foreign(str(values.get("text", "")))


def what_and_cure(what: str, cure: str) -> str:
    """Join the problem and its cure in a sentence, without the evidence."""
    return tr("{what}; {cure}.", what=what, cure=cure)


def accepted_text(finding: str, reason: str) -> str:
    """Return the finding with the reason, if there is any, to let it stand."""
    return tr("{finding} Accepted: {given}", finding=finding, given=reason) if reason else finding


def in_quotes(text: str) -> str:
    """Return text for a terminal: what is to be written stands in quotes, not in backticks."""
    return text.replace("`", '"')


def what_of(kind: str, variant: str, values: Values) -> str:
    """Describe what is seen and what it probably is, as a sentence begins."""
    text = filled(WHAT[key_of(kind, variant)], _placeholders(values))
    return text[0].upper() + text[1:]


def cure_of(kind: str, variant: str, values: Values) -> str:
    """Return the cure in words."""
    key = key_of(kind, variant)
    cures = TABLE_CURES if values.get("unmapped") and key in TABLE_CURES else CURES
    return filled(cures[key], _placeholders(values))


def evidence_of(values: Values) -> str:
    """Describe what undoing the mistake changes, and how much it matters; empty where poses alone show it."""
    given, seen = _placeholders(values), values.get("seen", "")
    evidence = filled(EVIDENCE[seen], given) if seen else ""
    # where a size was absurd, a gap in millimetres and a centre's way say nothing
    effect = filled(EFFECTS[values["effect"]], given) if "effect" in values and seen not in _SIZES else ""
    if evidence and effect:
        return tr("{evidence} ({effect})", evidence=evidence, effect=effect)
    return evidence or (tr("put right, {effect}", effect=effect) if effect else "")


def _placeholders(values: Values) -> dict[str, Any]:
    """Return the values, and the phrases that are made of several of them."""
    given: dict[str, Any] = {"n": values.get("count", 1), **values}
    if "first_s" in values:
        given["at"] = tr("at {time_s:.2f} s", time_s=values["first_s"])
    elif "first_row" in values:
        given["at"] = tr("in row {row} of its rows", row=values["first_row"])
    if "others" in values:
        given["also"] = _also(values["others"])
    if "counts" in values:
        of = zip(values["counts"], values["of"], strict=True)
        given["segment"] = values["of"][0]
        given["which"] = tr(", ").join(tr("{n} of {segment}", n=count, segment=name) for count, name in of)
    if "negated" in values:
        given["negated"] = listed(values["negated"])
    if "spiked" in values:
        given["spiked"] = tr(", ").join(_pose(*one) for one in values["spiked"])
    if "pairs" in values:
        given["exchanged"] = ", ".join(
            tr("{code} with {code_2}", code=a, code_2=b) for a, b in values["pairs"]
        )
    if "columns" in values:
        given["millimetres"] = ", ".join(f"{axis}_mm" for axis in values["columns"].split(", "))
    if "frames" in values:
        template = (
            N_("{frames} frames and {duration_s:.2g} s") if "duration_s" in values else N_("{frames} frames")
        )
        given["length"] = tr(template, **values)
    if "turn_deg" in values:
        about = (
            N_("{deg} deg about its {axis} axis") if values["turn_axis"] else N_("{deg} deg about a diagonal")
        )
        given["how"] = tr(about, deg=values["turn_deg"], axis=values["turn_axis"])
        axes = (f"{name}: {values[name]}" for name in ("distal", "lateral", "dorsal"))
        given["receiver_axes"] = f"{{{', '.join(axes)}}}"
    if "task" in values:
        given["other"] = _recording(values)
    # what is to be written into a file stays as it is, whatever the language
    given["code"] = values.get("segment", values.get("hand", ""))
    return given


def _pose(segment: str, frame: int, time_s: float | None = None) -> str:
    if time_s is None:
        return tr("{segment} in frame {n}", segment=segment, n=frame)
    return tr("{segment} in frame {n} ({time_s:.2f} s)", segment=segment, n=frame, time_s=time_s)


def _also(others: int) -> str:
    if not others:
        return ""
    return ngettext(", and so does another receiver", ", and so do {n} other receivers", others)


def _recording(values: Values) -> str:
    """Name another recording: the subject's own by hand and task, else with its subject."""
    if not values["subject"]:
        return tr("the {hand} hand's {task}", **values)
    if not values["session"]:
        return tr("subject {subject}, {hand} hand, {task}", **values)
    return tr("subject {subject}, session {session}, {hand} hand, {task}", **values)
