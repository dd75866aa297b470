"""Why a result is missing or weak: a kind and values, kept as such in tables, and as an English sentence.

A `Message` is its English sentence, so that whoever only hands it on needs to know no more; beside it it has
the kinds and values that it was made of, from which a page makes the sentence in its own language.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from shukotsu.sentences.finding_sentences import WHAT, key_of, what_of, whole_sentence
from shukotsu.sentences.translation import N_, Template, filled, foreign, plural, tr

MESSAGES: Mapping[str, Template] = {
    "no-valid-pose": N_("no valid pose of {segments}; check that receiver"),
    "few-frames": N_("{segment} and {segment_2} have {count} valid frames in common; expected 2 or more"),
    "not-moved": N_("the joint did not move, so its centre cannot be found; record it moving"),
    "no-calibration": N_("no calibration recording: {reason}"),
    "none-named": N_("the study names none"),
    "no-calibration-left": N_("no calibration recording is left: {finding}"),
    "axis-in-plane": N_("the axis lies in the plane that should cut it"),
    "nowhere": N_(
        "no receiver on {segments}: no worn receiver carries the centre; what is known is in bone_lengths "
        "and bone_poses"
    ),
    "no-pose": N_("no valid pose in the calibration"),
    "came-loose": N_(
        "came loose in {recording} at {moment}: it moved {mm:.1f} mm and turned {deg:.0f} deg on its bone"
    ),
    "slid": N_(
        "slid in {recording} between {moment} and {moment_2}: it moved {mm:.1f} mm and turned {deg:.0f} deg "
        "on its bone"
    ),
    "sits-elsewhere": N_(
        "sits elsewhere in {recording} than in the calibration, from {moment} on: it moved {mm:.1f} mm and "
        "turned {deg:.0f} deg on its bone, or more about its joint's own axis; from then on {joints} have no "
        "angles there; put it back or calibrate with it as it sits, and record {recording} again"
    ),
    "start": N_("the start"),
    "in-disturbed-field": N_(
        "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: there it is off by "
        "{mm:.1f} mm and {deg:.0f} deg"
    ),
    "moment": N_("{time_s:.1f} s"),
    "moment-frame": N_("frame {frame}"),
    "left-out-share": N_("{percent:.0f} % of its frames were left out"),
    "all-used": N_("all of its frames were used, as no joint centre is the worse for it"),
    "no-wrist-fit": N_("the wrist joint was not fitted: {reason}"),
    "no-forearm": N_("no receiver on the forearm"),
    "no-wrist-point": N_("layout {layout} has no wrist.point_mm"),
    "configured": N_("as configured in the layout"),
    "keeps-distance": plural(
        "the point that keeps its distance from {n} MCP joint",
        "the point that keeps its distance from {n} MCP joints",
    ),
    "average-wrist": N_("the average hand's wrist; there is no forearm receiver and no MCP joint to go by"),
    "by-metacarpals": N_("where the metacarpals' bases say; there is no forearm receiver"),
    "no-pose-to-replay": N_("the recording has no pose of {segments}, which the replay rides on"),
    "never-together": N_("no frame in which all of {segments} are valid"),
    "joint-failed": N_("{joint} failed: {reason}"),
    "not-worn": N_("no receiver was worn on both sides of it"),
    "not-solved": N_("it was not solved"),
    "joint-not-solved": N_("the joint was not solved"),
    "not-believed": N_("its centre is not to be believed"),
    "no-error-stated": N_(
        "the model states no error of its angles, and how receivers sit on their bones is in them"
    ),
    "metacarpal-still": N_(
        "the model keeps the metacarpal still in the hand, so the CMC joint's motion is in the MCP joint's "
        "angles"
    ),
    "no-anatomy": N_("no published anatomy of this digit"),
    "no-whole-hand": N_(
        "model {model} fits a whole hand, and layout {layout} is none, as no digit in it is a thumb or a "
        "finger whose anatomy is known; take model paper-fig4, which solves each joint by itself"
    ),
    "alone-by-finding": N_(
        "fitted without the {hand} hand's bone lengths: there is a finding on the {hand_2} hand's {task}"
    ),
    "alone": N_("fitted without the {hand} hand's bone lengths: {reason}"),
    "none-at-both": N_("no subject has a value at both levels"),
    "none-at-one": N_("no subject has a value at one of the levels"),
    "few-at-both": plural(
        "not tested: {n} subject has both levels, a test needs {least}",
        "not tested: {n} subjects have both levels, a test needs {least}",
    ),
    "few-in-group": N_("not tested: groups of {count} and {count_2} subjects, a test needs {least} in each"),
    "few-levels": plural("has {n} level, so nothing is compared", "has {n} levels, so nothing is compared"),
    "is-covariate": N_("has {count} numbers as levels, which are not compared pair by pair"),
    "many-levels": N_(
        "has {count} levels; at most {most} are compared pair by pair; put groups of them into the sheet's "
        "column"
    ),
    "few-repeated": plural(
        "not stated: {n} subject is in all {times}, it takes {least}",
        "not stated: {n} subjects are in all {times}, it takes {least}",
    ),
    "internal": N_("internal error in {stage} ({text}); please report it with the log"),
    "recording/no-pose": N_("no usable pose of {segments}; check that receiver"),
    "hand/uncalibrated": N_("no recording calibrates this hand, so none of its joints could be solved"),
    "knuckles-too-close": N_(
        "{joints} lie {mm:.1f} mm apart, nearer than in any hand: look at the receivers on these fingers"
    ),
    "receiver": N_("{segment}: {message}"),
    "receiver-loose": N_("{segment}: {message}"),
    "receiver-slid": N_("{segment}: {message}"),
    "receiver-moved": N_("{segment}: {message}"),
    "field-disturbed": plural(
        "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: {n} receiver is off by up "
        "to {mm:.1f} mm and {deg:.0f} deg there ({segments}); {percent:.0f} % of its frames were left out",
        "the field is disturbed near ({x:.0f}, {y:.0f}, {z:.0f}) mm, as by metal: {n} receivers are off by "
        "up to {mm:.1f} mm and {deg:.0f} deg there ({segments}); {percent:.0f} % of a receiver's frames, at "
        "the most, were left out",
    ),
}
"""By kind. What a placeholder stands for may be a message itself, or a list of names."""


class Message(str):
    """One or several sentences, as English text. parts : kind and values of each, as JSON has them; of text
    from elsewhere `text`, of a quoted finding `finding`, `variant`, `values` and whether it is whole.
    """

    parts: tuple[Mapping[str, Any], ...]

    def __new__(cls, text: str, parts: Iterable[Mapping[str, Any]]) -> Message:
        """Put a text and what it is made of together."""
        made = super().__new__(cls, text)
        made.parts = tuple(parts)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments that copy it."""
        return Message, (str(self), self.parts)


def message_of(kind: str, **values: Any) -> Message:
    """Make a message of one kind."""
    return _made([{"kind": kind, **{name: plain(value) for name, value in values.items()}}])


def joined(texts: Iterable[str]) -> Message:
    """Make one message of several, each once; of none an empty one."""
    own = list(dict.fromkeys(filter(None, texts)))
    parts = (text.parts if isinstance(text, Message) else ({"text": text},) for text in own)
    return Message("; ".join(own), (part for each in parts for part in each))


def of_finding(kind: str, variant: str, values: Mapping[str, Any], *, whole: bool = False) -> Message:
    """Make a message of what a finding sees; whole : and of what shows it and what to do."""
    return _made([{"finding": kind, "variant": variant, "values": values, "whole": whole}])


def sentence_of(kind: str, variant: str, values: Mapping[str, Any], accepted: str = "") -> str:
    """Say a problem: a finding whole, another by its kind, or by the message or text among its values."""
    key = key_of(kind, variant)
    if key in WHAT:
        return whole_sentence(kind, variant, values, accepted)
    if key in MESSAGES:
        return _sentence({"kind": key, "n": values.get("count", 1), **values})
    return message_text(values["message"]) if "message" in values else foreign(str(values.get("text", "")))


def values_text(text: str) -> str:
    """Return a message's kind and values as tables keep them: JSON, empty where there is nothing."""
    return json.dumps(text.parts, ensure_ascii=False) if isinstance(text, Message) and text.parts else ""


def read_message(text: str, values: str) -> str:
    """Give the message of a table's two columns, or its text where that is all that can be read."""
    try:
        parts = json.loads(values) if values else None
    except (ValueError, RecursionError):
        return text
    is_message = isinstance(parts, list) and all(isinstance(part, dict) for part in parts)
    return Message(text, parts) if is_message and parts else text


def translated(text: str) -> str:
    """Give a message, or a text of the catalogue, in the language in use; another text marked as English."""
    if isinstance(text, Message):
        try:
            return message_text(text.parts)
        except (KeyError, ValueError, TypeError):  # of a table that another version wrote, or somebody edited
            return foreign(str(text))
    own = tr(text)
    return own if own != text else foreign(text)


def message_text(parts: Iterable[Mapping[str, Any]]) -> str:
    """Give the parts of a message as a sentence in the language in use."""
    return "; ".join(map(_sentence, parts))


def plain(value: Any) -> Any:
    """Give a value as JSON keeps it, numbers to six digits."""
    if isinstance(value, str):
        return list(value.parts) if isinstance(value, Message) else value
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _made(parts: Sequence[Mapping[str, Any]]) -> Message:
    return Message(message_text(parts), parts)


def _sentence(part: Mapping[str, Any]) -> str:
    if "kind" not in part and "text" in part:
        return foreign(part["text"])
    if "kind" not in part:
        say = sentence_of if part["whole"] else what_of
        return say(part["finding"], part["variant"], part["values"])
    values = {name: _shown(value) for name, value in part.items() if name != "kind"}
    return filled(MESSAGES[part["kind"]], values)


def _shown(value: Any) -> Any:
    """A value as a sentence shows it: a message in it as a sentence."""
    is_message = isinstance(value, list) and value and isinstance(value[0], dict)
    return message_text(value) if is_message else value
