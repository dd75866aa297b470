"""Say what the coach knows, in the operator's language: the state that both faces show, in JSON types.

Words of the body, one instruction at a time, never a number for what was not done.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from shukotsu.coach.drawn_hand import skeleton
from shukotsu.coach.movements import MOVEMENTS
from shukotsu.coach.requests import MEASURE, TOUCHING
from shukotsu.schemas.verdict import BELIEVE, BY_ANATOMY, HALVES, MOVED_LITTLE, ONE_WAY, UNCERTAIN
from shukotsu.sentences.finding_sentences import in_quotes
from shukotsu.sentences.translation import N_, language, listed, tr, word
from shukotsu.stages.report.belief import reasons_of

if TYPE_CHECKING:
    from shukotsu.coach.coach import Coach

MOST_LOGGED, HARDLY_DEG = 50, 15.0
_JOINTS = {
    "thumb_cmc": N_("base of the thumb (CMC)"),
    "thumb_mcp": N_("middle joint of the thumb (MCP)"),
    "thumb_ip": N_("tip joint of the thumb (IP)"),
    "mcp": N_("knuckle of the {digit} finger (MCP)"),
    "pip": N_("middle joint of the {digit} finger (PIP)"),
    "dip": N_("fingertip joint of the {digit} finger (DIP)"),
    "cmc": N_("base of the {digit} finger (CMC)"),
}
"""Joints in words of the body."""

_MOVEMENTS = {
    "free": N_("Move every finger and the thumb, each its own way, widely: bend, stretch and spread."),
    "fist": N_("Close the hand to a fist and open it wide, twice."),
    "hook": N_("Keep the knuckles straight; bend the fingers to a hook and stretch them, twice."),
    "knuckles": N_("Keep the fingers straight; bend them at the knuckles, then draw them back, twice."),
    "spread": N_("Keep the fingers straight; spread them apart and close them, twice."),
    "fingertip": N_("Bend the {digit} fingertip alone; hold the middle joint with the other hand."),
    "alone": N_("Bend the {digit} finger alone, all of it, and stretch it, twice."),
    "thumb-circle": N_("Draw a large circle with the thumb, from its base, both ways."),
    "thumb-middle": N_("Bend the thumb at its middle joint alone, and stretch it, twice."),
    "thumb-tip": N_("Bend the thumb's tip joint alone; hold the bone before it with the other hand."),
    "cup": N_("Cup the palm as if round a ball: press thumb and little finger towards each other, twice."),
    "opposition": N_("Lay the thumb's pad on the pad of each finger in turn; hold each for a moment."),
}
_MEASURED = {
    "": N_("Measure with the calliper, joint to joint, how long the {bone} is; type it."),
    "along": N_("Measure how far along the {bone} its receiver sits, from the joint before it; type it."),
    "lateral": N_("Measure how far to the thumb's side of the {bone} its receiver sits; type it."),
    "height": N_("Measure how high over the {bone} its receiver sits; type it."),
    "distal": N_("Measure how far from the next joint the receiver of the {bone} sits; type it."),
}
_TOUCHED = N_("Lay the very end of the {digit} finger on {point}, hold it there and mark it.")
_THUMB_TOUCHED = N_("Lay the very end of the thumb on {point}, hold it there and mark it.")


_SEEN = {
    "done": N_("Seen, well done."),
    "again": N_("Seen; once more."),
    "entered": N_("Entered; it is used from now on."),
    "skipped": N_("Left out."),
    "put-right": N_("Put right. The calibration begins anew; what was recorded before is not used."),
    "further": N_("The {body} moved {deg:.0f} deg: a little further."),
    "instead": N_("The {moved} moved instead of the {body}: try again."),
    "gave-up": N_("The {body} moved {deg:.0f} deg only: it may be stiff, or its receiver loose. Going on."),
}
"""What is said of what was done."""


def joint_name(joint: str) -> str:
    """Name a joint in words of the body."""
    digit, _, kind = joint.rpartition("_")
    sentence = _JOINTS.get(joint) or _JOINTS.get(kind if digit else "")
    return word(joint) if sentence is None else tr(sentence, digit=digit)


def request_sentence(kind: str, name: str, points: Mapping[str, Any]) -> str:
    """Give what to do in one imperative sentence."""
    if kind == MEASURE:
        bone, _, part = name.partition(".")
        return tr(_MEASURED[part], bone=word(bone) if language() != "en" else bone.replace("_", " "))
    if kind == TOUCHING:
        return tr(_THUMB_TOUCHED if name == "thumb" else _TOUCHED, digit=name, point=next(iter(points), "?"))
    stem, _, digit = name.partition("-")
    return tr(_MOVEMENTS[name]) if name in _MOVEMENTS else tr(_MOVEMENTS[stem], digit=digit)


def sentence_of(what: Mapping[str, Any], coach: Coach) -> str:
    """Give the sentence of an entry of the log."""
    kind = what["kind"]
    if kind == "finding":
        return str(in_quotes(what["finding"].message))
    if kind == "silent":
        return tr("Nothing comes from the receiver on {segment}: is it connected?", segment=what["segment"])
    if kind == "asked":
        return request_sentence(what["option"], what["name"], coach.setup.points)
    if kind == "enough":
        return summary_sentence(what)
    if kind == "mark":
        return _mark_sentence(what)
    if kind == "loose":
        moved = {name: what[name] for name in ("segment", "mm", "deg", "time_s")}
        return tr(
            "The receiver on {segment} moved by {mm:.1f} mm and {deg:.0f} deg at {time_s:.0f} s: tape it "
            "anew, finish and start again.",
            **moved,
        )
    if kind == "not-used":
        return tr("Not used: {reason}.", reason=what["reason"])
    if kind == "no-estimate":
        return tr("No estimate yet: {reason}.", reason=what["reason"])
    values = {
        name: joint_name(what[own]) for name, own in (("body", "joint"), ("moved", "other")) if own in what
    }
    return tr(_SEEN[kind], deg=what.get("deg"), **values)


def _mark_sentence(what: Mapping[str, Any]) -> str:
    if what["what"] == "touch":
        if what.get("meets"):
            return tr("Marked: the pads of {digits} meet.", digits=[what["digit"], what["meets"]])
        return tr("Marked: {digit} on {point}.", digit=what["digit"], point=what.get("point", ""))
    if what["what"] == "length":
        return tr(
            "Measured: {quantity} is {value_mm:g} mm.",
            quantity=what["quantity"],
            value_mm=float(what["value_mm"]),
        )
    said = {
        "undo": N_("Taken back."),
        "done": N_("Said to be done."),
        "skip": N_("Left out by hand."),
        "finish": N_("Ended by hand."),
    }
    sentence = said.get(what["what"])
    return str(what.get("text", what["what"])) if sentence is None else tr(sentence)


def summary_sentence(summary: Mapping[str, Any]) -> str:
    """Say what a calibration came to: the seconds, and the joints that are left, by why they are."""
    by_reason: dict[str, list[str]] = {}
    for own in summary["left"]:
        named = tr("{body} at {sd_mm:.1f} mm", body=joint_name(own["joint"]), sd_mm=own["sd_mm"])
        by_reason.setdefault(_reason(own), []).append(named)
    if [len(own) for own in by_reason.values()] == [summary["of"]]:
        by_reason = {why: [tr("all joints")] for why in by_reason}
    whole = tr(
        "Calibrated in {seconds:.0f} s, {believed} of {of} joints good enough",
        **{name: summary[name] for name in ("seconds", "believed", "of")},
    )
    left = [tr("left are {left}: {reason}", left=listed(own), reason=why) for why, own in by_reason.items()]
    return "; ".join([whole, *left]) + tr(".")


def _reason(left: Mapping[str, Any]) -> str:
    unsure = left["reason"] in (UNCERTAIN, ONE_WAY, BY_ANATOMY)
    if left["reason"] == MOVED_LITTLE or (unsure and left["range_deg"] < HARDLY_DEG):
        return tr("it hardly bends")
    if left["reason"] == HALVES:
        return tr("its two receivers disagree")
    return tr("no movement would tell more") if unsure else reasons_of({**left, "message": ""})[0]


def state_of(coach: Coach) -> dict[str, Any]:
    """Give the state as JSON types: see the page's script for what each key is shown as."""
    rows = {} if coach.known is None else coach.known.rows
    return {
        "time_s": coach.time_s,
        "phase": coach.phase,
        "findings": [sentence_of(own, coach) for own in coach.findings]
        + [sentence_of(own, coach) for own in coach.loose],
        "request": _request(coach),
        "done": None if coach.done is None else _done(coach.done, coach),
        "joints": [_joint(name, row) for name, row in rows.items()],
        "wanted_mm": coach.setup.wanted_mm,
        "settled": sum(row["verdict"] == BELIEVE for row in rows.values()),
        "of": len(rows),
        "skeleton": None if coach.known is None else skeleton(coach.known.tips),
        "receivers": list(coach.layout.measured),
        "log": [
            {"time_s": time_s, "sentence": sentence_of(what, coach)}
            for time_s, what in coach.log[-MOST_LOGGED:]
        ],
        "logged": len(coach.log),
        "summary": summary_sentence(coach.summary()) if coach.phase in ("enough", "ended") and rows else None,
    }


def _done(done: Mapping[str, Any], coach: Coach) -> dict[str, Any]:
    success = {"done": True, "again": True, "entered": True, "gave-up": False, "instead": False}.get(
        done["kind"]
    )
    return {"number": done["number"], "sentence": sentence_of(done, coach), "success": success}


def _joint(name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    sd_mm = float(row["sd_mm"])
    return {
        "joint": name,
        "name": joint_name(name),
        "sd_mm": round(sd_mm, 3),
        "verdict": row["verdict"],
        "reason": "" if row["verdict"] == BELIEVE else next(iter(reasons_of(row)), ""),
    }


def _request(coach: Coach) -> dict[str, Any] | None:
    request = coach.request
    if request is None:
        return None
    option, movement = request.option, MOVEMENTS.get(request.option.name)
    return {
        "number": request.number,
        "kind": option.kind,
        "name": option.name,
        "sentence": request_sentence(option.kind, option.name, coach.setup.points),
        "times": request.times,
        "seconds": option.seconds,
        "joints": [] if movement is None else list(movement.joints),
        "drawing": request.drawing,
    }
