"""The sentences of findings, made where they are shown: of a kind, its variant and its values.

`say` puts values into a template's placeholders; the report's does so in its language. Without one, English.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Values = Mapping[str, Any]
"""By name: numbers, words, or lists of them, as JSON has them."""
Say = Callable[..., str]


@dataclass(frozen=True)
class Sentence:
    """Templates. what : is seen, and probably is. cure : what to do, word for word. one : `what` of a `count`
    of 1. table : what to do where the recording came without a mapping, `unmapped` among the values.
    """

    what: str
    cure: str
    one: str = ""
    table: str = ""


_POSITION_UNIT = "write `position_unit: {true}` in the mapping"
_IN_MM = "multiply x_mm, y_mm and z_mm by {factor:g} in the file"
_RENAMED = "name the file's columns qw, qx, qy, qz anew: qx, qy, qz, qw"
_POSITION_AXES = "write `position_axes: [{columns}]` in the mapping"
_IN_PLACE = "put {millimetres} in place of x_mm, y_mm, z_mm in the file"
_OTHER_HAND = "write `{code}` in the column hand of the recordings sheet (or --hand {code})"
_MIRRORED = ", or, if it is a {hand_2} hand and the file mirrored, "
_REPAIR = "write `repair` in the column hemisphere of the recordings sheet (or --repair-hemisphere)"
_EMPTY = "leave the numbers of these poses empty in the file"
_NAMES = "exchange these names in `receivers` of the mapping: {exchanged}"
_NAMES_IN_FILE = (
    "exchange these names in the file's column segment or, where the file has stations, their station "
    "numbers in the layout: {exchanged}"
)
_AGAIN = "record it again, or give a reason under `exclude` in the recordings sheet"

SENTENCES: Mapping[str, Mapping[str, Sentence]] = {
    "quaternion-order": {
        "order": Sentence(
            "the quaternions are read as {read} and seem to be {true}",
            "write `order: {order}` under `orientation` in the mapping",
            table=_RENAMED,
        ),
        "inverse-too": Sentence(
            "the quaternions seem to be {true} of the inverse rotation",
            "write `order: {order}` and `rotates: {rotates}` under `orientation` in the mapping",
            table=f"{_RENAMED}, and negate qx, qy and qz",
        ),
    },
    "quaternion-inverse": {
        "": Sentence(
            "the rotations seem to be the inverse of what is declared",
            "write `rotates: {rotates}` under `orientation` in the mapping",
            table="negate qx, qy and qz in the file",
        ),
        "matrices": Sentence(
            "the matrices seem to be the inverse of what is declared",
            "write `orientation: {{kind: matrix, rotates: {rotates}}}` in the mapping",
        ),
    },
    "euler-order": {
        "axes": Sentence(
            "the angles are read as {read} and seem to be {true}",
            "write `axes: {true}` under `orientation` in the mapping",
        ),
        "fixed": Sentence(
            "the angles are read as {read} about turning axes and seem to be about fixed ones",
            "write `axes: {true}` under `orientation` in the mapping, and the columns of each receiver's "
            "`orientation` in the opposite order",
        ),
    },
    "units": {
        "positions-small": Sentence(
            "the positions are {factor:.4g} times too small, in {true} and read as {read}",
            _POSITION_UNIT,
            table=_IN_MM,
        ),
        "positions-large": Sentence(
            "the positions are {factor:.4g} times too large, in {true} and read as {read}", _POSITION_UNIT
        ),
        "radians": Sentence(
            "the angles are read as degrees and seem to be radians",
            "write `unit: rad` under `orientation` in the mapping",
        ),
        "degrees": Sentence(
            "the receivers turn at {speed_rad_s:.0f} rad/s: the angles seem to be degrees and are read as "
            "radians",
            "write `unit: deg` under `orientation` in the mapping",
        ),
    },
    "time-unit": {
        "": Sentence(
            "the times make {rate_hz:.3g} frames a second: they seem to be in {unit} and are read as {read}",
            "write `time_unit: {unit}` under `csv` in the mapping",
            table="multiply time_s by {factor:g} in the file",
        ),
        "scaled": Sentence(
            "the times make {rate_hz:.3g} frames a second: they seem to be in another unit than {read}",
            "multiply the times by {factor:g} in the file",
        ),
        "rate": Sentence(
            "the times make {rate_hz:.3g} frames a second, as `rate_hz` says, and there seem to be "
            "{true_hz:.3g}",
            "write `rate_hz: {true_hz:g}` in the mapping",
        ),
    },
    "hemisphere": {
        "jumps": Sentence(
            "the position of {segment} jumps to the other side of the transmitter {count} times, first "
            "{at}{also}: the tracker took the wrong hemisphere",
            _REPAIR,
            "the position of {segment} jumps to the other side of the transmitter 1 time, first {at}{also}: "
            "the tracker took the wrong hemisphere",
        ),
        "all-along": Sentence(
            "the receivers {segments} seem to be on the other side of the transmitter all along",
            _REPAIR,
            "the receiver {segments} seems to be on the other side of the transmitter all along",
        ),
        "left-out": Sentence(
            "{count} poses ({which}) are on the other side of the transmitter and left out: the tracker took "
            "the wrong hemisphere",
            f"{_REPAIR} to put them back",
            "one pose, of {segment}, is on the other side of the transmitter and left out: the tracker took "
            "the wrong hemisphere",
        ),
        "between": Sentence(
            "{count} poses ({which}) are between the two sides of the transmitter, where the tracker's "
            "filter smears a jump, and left out",
            "nothing has to be done",
        ),
        "put-back": Sentence(
            "{count} poses ({which}) were put back from the other side of the transmitter, as was asked for",
            "nothing more has to be done",
        ),
        "undecided": Sentence(
            "{count} poses ({which}) are of a receiver that was on both sides of the transmitter, or on "
            "another than its neighbours, and nothing tells which is right; they are kept as recorded",
            f"{_EMPTY} where they are on the wrong side, or give a reason under `exclude` in the "
            "recordings sheet",
        ),
    },
    "receiver-stuck": {
        "repeated": Sentence(
            "in {percent:.0f} % of the frames every receiver stands as in the frame before: probably the "
            "program repeats the last values",
            "write `in_step: false` under `csv` and the tracker's `rate_hz` in the mapping",
            table="leave the rows out of the file that repeat those of the frame before",
        ),
        "at-times": Sentence(
            "the receiver {segment} gives one and the same pose in {percent:.0f} % of its frames, first "
            "{at}, while others move: probably its channel hung",
            "leave its numbers empty in the file where they repeat those before, or leave the recording out "
            "with `exclude` in the recordings sheet",
        ),
        "all-along": Sentence(
            "the receiver {segment} gives one and the same pose all along while others move, and is not "
            "used: probably its channel hung",
            "check its plug, and record again",
        ),
    },
    "spikes": {
        "some": Sentence(
            "{count} poses are where nothing can be, such as {spiked}: probably the tracker's field was "
            "disturbed or a row is damaged",
            f"{_EMPTY}, and check again",
            "one pose is where nothing can be, {spiked}: probably the tracker's field was disturbed or a row "
            "is damaged",
        ),
        "left-out": Sentence(
            "{count} poses ({which}) are where nothing can be and left out: the tracker's field was probably "
            "disturbed",
            "look for metal or a motor near the transmitter",
            "one pose, of {segment}, is where nothing can be and left out: the tracker's field was probably "
            "disturbed",
        ),
        "all": Sentence(
            "the poses jump about from frame to frame as no body moves, and no joint closes: these are "
            "probably not the columns of positions and orientations",
            "name the right ones in the mapping",
            table="put the right ones into the file",
        ),
    },
    "receivers-swapped": {
        "": Sentence(
            "the receivers {segment} and {segment_2} seem to be swapped",
            "exchange their names in `receivers` of the mapping",
            table="exchange their names in the file's column segment or, where the file has stations, their "
            "station numbers in the layout",
        ),
    },
    "digits-swapped": {
        "two": Sentence(
            "the {digit} and the {digit_2} finger seem to be swapped",
            _NAMES,
            table=_NAMES_IN_FILE,
        ),
        "reversed": Sentence(
            "the fingers seem to be named in the opposite order",
            _NAMES,
            table=_NAMES_IN_FILE,
        ),
    },
    "wrong-hand": {
        "": Sentence(
            "this seems to be a {hand} hand",
            f"{_OTHER_HAND}{_MIRRORED}export it from a right-handed frame",
            table=f"{_OTHER_HAND}{_MIRRORED}negate y_mm, qx and qz in it",
        ),
    },
    "axes-mirrored": {
        "negated": Sentence(
            "the positions' {negated} seem to be negated",
            _POSITION_AXES,
            "the positions' {negated} seems to be negated",
            _IN_PLACE,
        ),
        "exchanged": Sentence(
            "the x, y, z of the rotations' frame seem to be {columns} of the positions",
            _POSITION_AXES,
            table=_IN_PLACE,
        ),
    },
    "receiver-turned": {
        "all": Sentence(
            "all receivers seem to be turned on their bones by {how}",
            "write `receiver_axes: {receiver_axes}` in the layout",
        ),
        "one": Sentence(
            "the receiver {segment} seems to be turned on its bone by {how}",
            "write `receiver_axes: {receiver_axes}` under the segment {code} in the layout",
        ),
    },
    "other-person": {
        "another": Sentence(
            "the hand is {scale:.2f} times the average size and its bones are of other lengths than in "
            "{other} ({usual:.2f} times): probably this is another person",
            "correct the column subject or file of the recordings sheet",
        ),
        "put-on-anew": Sentence(
            "the receivers sit elsewhere on the bones than in {other}, and the bones are about as long: "
            "probably they were put on anew",
            "give this recording a session of its own in the column session of the recordings sheet",
        ),
    },
    "same-file": {
        "": Sentence(
            "all poses are, number by number, those of {other}: probably one file is named twice",
            "correct the column file of the recordings sheet, or give a reason under `exclude` for one of "
            "the two",
        ),
    },
    "too-short": {
        "": Sentence(
            "the recording has {length}, too short for a joint to show how it moves: probably it was stopped "
            "at once or the file is cut off",
            _AGAIN,
        ),
    },
    "zeros": {
        "": Sentence(
            "{count} poses, most of {segment}, first {at}, are at 0, 0, 0 and not turned, to the last bit: "
            "probably the program writes zeros where it has no value",
            _EMPTY,
            "one pose, of {segment}, first {at}, is at 0, 0, 0 and not turned, to the last bit: probably the "
            "program writes zeros where it has no value",
        ),
    },
    "unchecked": {
        "": Sentence(
            "the recording could not be checked: {reason}", "whatever is shown of it rests on no check"
        ),
    },
    "receivers-alike": {
        "": Sentence(
            "the receivers {segment} and {segment_2} have one and the same pose in {percent:.0f} % of their "
            "frames, first {at}, which two receivers cannot: probably one is read, or was exported, in place "
            "of the other",
            "name each one's own columns or `value` in the mapping, or export the file again",
            table="export the file again, each receiver with numbers of its own",
        ),
    },
}
"""By kind of docs/mistakes.md and variant."""

EVIDENCE: Mapping[str, str] = {
    "scale": "the hand comes out {before:.2g} times the average size, put right {after:.2g} times",
    "reach": "joints come out {before:.2g} mm from the receivers, put right {after:.0f} mm",
    "gap": "put right, the gap of {joint} falls from {before:.1f} to {after:.1f} mm",
    "place": "{joint} is {before:.0f} mm from where an average hand has it, put right {after:.0f} mm",
    "turn": "the {angle} of {joint} is {least:.0f} to {most:.0f} deg, put right {least_after:.0f} to "
    "{most_after:.0f} deg",
}
"""By what is seen, `seen` among the values: what undoing a mistake changes most."""

_SIZES = ("scale", "reach")

EFFECTS: Mapping[str, str] = {
    "closer": "the median gap of the joints concerned falls from {gap_before_mm:.1f} to {gap_after_mm:.1f} "
    "mm, centres that move by more than 2 mm: {moved} of {joints}",
    "no-closer": "the joints concerned close as they did, with a median gap of {gap_before_mm:.1f} and "
    "{gap_after_mm:.1f} mm, centres that move by more than 2 mm: {moved} of {joints}",
    "none": "no joint closes better and no centre moves by more than 2 mm, so nothing measurable is gained",
}
"""By `effect` among the values: how much it matters."""

OTHER_PROBLEMS: Mapping[str, Mapping[str, str]] = {
    "recording": {"no-pose": "no usable pose of {segments}; check that receiver"},
    "hand": {"uncalibrated": "no recording calibrates this hand, so none of its joints could be solved"},
    **{kind: {"": "{segment}: {message}"} for kind in ("receiver", "receiver-loose", "receiver-slid")},
    "field-disturbed": {
        "": "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: {count} receivers are "
        "off by up to {mm:.1f} mm and {deg:.0f} deg there ({segments}); {percent:.0f} % of a receiver's "
        "frames, at the most, were left out"
    },
}
"""Whole sentences of problems that are no mistakes of a declaration, by kind and variant."""

_EVIDENCE_AND_EFFECT, _EFFECT_ALONE = "{evidence} ({effect})", "put right, {effect}"
_WHOLE, _WITHOUT_EVIDENCE = "{what}: {evidence}; {cure}.", "{what}; {cure}."
_WITH_EFFECT = "{what} ({evidence}); {cure}."
_ACCEPTED = "{finding} Accepted: {given}"
_POSE, _POSE_AND_TIME = "{segment} in frame {n}", "{segment} in frame {n} ({time_s:.2f} s)"
_PAIR = "{code} with {code_2}"
_TIME, _ROW = "at {time_s:.2f} s", "in row {row} of its rows"
_ONE_OTHER, _OTHERS = ", and so does another receiver", ", and so do {n} other receivers"
_FRAMES, _FRAMES_AND_TIME = "{frames} frames", "{frames} frames and {duration_s:.2g} s"
_OF_SEGMENT = "{n} of {segment}"
_ABOUT_AXIS, _ABOUT_DIAGONAL = "{deg} deg about its {axis} axis", "{deg} deg about a diagonal"
_OWN_RECORDING, _RECORDING = "the {hand} hand's {task}", "subject {subject}, {hand} hand, {task}"
_RECORDING_IN_SESSION = "subject {subject}, session {session}, {hand} hand, {task}"


def templates() -> Iterator[str]:
    """Give every template, for catalogues of other languages."""
    for variants in SENTENCES.values():
        for sentence in variants.values():
            yield from filter(None, (sentence.what, sentence.cure, sentence.one, sentence.table))
    for texts in OTHER_PROBLEMS.values():
        yield from texts.values()
    yield from (*EVIDENCE.values(), *EFFECTS.values())
    yield from (_EVIDENCE_AND_EFFECT, _EFFECT_ALONE)
    yield from (_WHOLE, _WITH_EFFECT, _WITHOUT_EVIDENCE, _ACCEPTED, _TIME, _ROW, _ONE_OTHER, _OTHERS, _FRAMES)
    yield from (_OF_SEGMENT, _POSE, _POSE_AND_TIME, _PAIR, _FRAMES_AND_TIME, _ABOUT_AXIS, _ABOUT_DIAGONAL)
    yield from (_OWN_RECORDING, _RECORDING, _RECORDING_IN_SESSION)


def english(template: str, **values: Any) -> str:
    """The template with values in its placeholders."""
    return template.format(**values) if values else template


def sentence_of(kind: str, variant: str, values: Values, accepted: str = "", say: Say = english) -> str:
    """The whole finding: what is seen, what shows it, what to do; accepted : the reason to let it stand.

    Of what has no template the `text` among its values.
    """
    if "text" in values:
        return say("{message}", message=values["text"])
    if kind in OTHER_PROBLEMS:
        return say(OTHER_PROBLEMS[kind][variant], **_placeholders(values, say))
    what, evidence = what_of(kind, variant, values, say), evidence_of(values, say)
    cure = cure_of(kind, variant, values, say)
    if not evidence:
        return accepted_text(what_and_cure(what, cure, say), accepted, say)
    template = _WHOLE if "seen" in values else _WITH_EFFECT
    return accepted_text(say(template, what=what, evidence=evidence, cure=cure), accepted, say)


def what_and_cure(what: str, cure: str, say: Say = english) -> str:
    """What is wrong and what to do, without what shows it."""
    return say(_WITHOUT_EVIDENCE, what=what, cure=cure)


def accepted_text(finding: str, reason: str, say: Say = english) -> str:
    """The finding with the reason, if there is any, to let it stand."""
    return say(_ACCEPTED, finding=finding, given=reason) if reason else finding


def in_quotes(text: str) -> str:
    """Text for a terminal: what is to be written stands in quotes, not in backticks."""
    return text.replace("`", '"')


def what_of(kind: str, variant: str, values: Values, say: Say = english) -> str:
    """What is seen and what it probably is, as a sentence begins."""
    if "text" in values:
        return str(values["text"])
    sentence = SENTENCES[kind][variant]
    template = sentence.one if sentence.one and values["count"] == 1 else sentence.what
    text = say(template, **_placeholders(values, say))
    return text[0].upper() + text[1:]


def cure_of(kind: str, variant: str, values: Values, say: Say = english) -> str:
    """What to do about it."""
    sentence = SENTENCES[kind][variant]
    template = sentence.table if sentence.table and values.get("unmapped") else sentence.cure
    return say(template, **_placeholders(values, say))


def evidence_of(values: Values, say: Say = english) -> str:
    """What undoing the mistake changes, and how much that matters; empty where poses alone show it."""
    given, seen = _placeholders(values, say), values.get("seen", "")
    evidence = say(EVIDENCE[seen], **given) if seen else ""
    # where a size was absurd, a gap in millimetres and a centre's way say nothing
    effect = say(EFFECTS[values["effect"]], **given) if "effect" in values and seen not in _SIZES else ""
    if evidence and effect:
        return say(_EVIDENCE_AND_EFFECT, evidence=evidence, effect=effect)
    return evidence or (say(_EFFECT_ALONE, effect=effect) if effect else "")


def _placeholders(values: Values, say: Say) -> dict[str, Any]:
    """The values, and the phrases that are made of several of them."""
    given = dict(values)
    if "first_s" in values:
        given["at"] = say(_TIME, time_s=values["first_s"])
    elif "first_row" in values:
        given["at"] = say(_ROW, row=values["first_row"])
    if "others" in values:
        given["also"] = _also(values["others"], say)
    if "segments" in values:
        given["segments"] = ", ".join(say("{segment}", segment=name) for name in values["segments"])
    if "counts" in values:
        of = zip(values["counts"], values["of"], strict=True)
        given["segment"] = values["of"][0]
        given["which"] = ", ".join(say(_OF_SEGMENT, n=count, segment=name) for count, name in of)
    if "negated" in values:
        given["negated"] = _listed(values["negated"], say)
    if "spiked" in values:
        given["spiked"] = ", ".join(_pose(*one, say=say) for one in values["spiked"])
    if "pairs" in values:
        given["exchanged"] = ", ".join(say(_PAIR, code=one, code_2=two) for one, two in values["pairs"])
    if "columns" in values:
        given["millimetres"] = ", ".join(f"{axis}_mm" for axis in values["columns"].split(", "))
    if "frames" in values:
        given["length"] = say(_FRAMES_AND_TIME if "duration_s" in values else _FRAMES, **values)
    if "turn_deg" in values:
        template = _ABOUT_AXIS if values["turn_axis"] else _ABOUT_DIAGONAL
        given["how"] = say(template, deg=values["turn_deg"], axis=values["turn_axis"])
        axes = (f"{name}: {values[name]}" for name in ("distal", "lateral", "dorsal"))
        given["receiver_axes"] = f"{{{', '.join(axes)}}}"
    if "task" in values:
        given["other"] = _recording(values, say)
    # what is to be written into a file stays as it is, whatever the language
    given["code"] = values.get("segment", values.get("hand", ""))
    return given


def _pose(segment: str, frame: int, time_s: float | None = None, *, say: Say) -> str:
    if time_s is None:
        return say(_POSE, segment=segment, n=frame)
    return say(_POSE_AND_TIME, segment=segment, n=frame, time_s=time_s)


def _also(others: int, say: Say) -> str:
    if others > 1:
        return say(_OTHERS, n=others)
    return say(_ONE_OTHER) if others else ""


def _listed(words: Sequence[str], say: Say) -> str:
    start, last = say(", ").join(words[:-1]), words[-1]
    return say(" and ").join([start, last]) if start else last


def _recording(values: Values, say: Say) -> str:
    """Another recording: the subject's own by hand and task, else with its subject."""
    if not values["subject"]:
        return say(_OWN_RECORDING, **values)
    return say(_RECORDING_IN_SESSION if values["session"] else _RECORDING, **values)
