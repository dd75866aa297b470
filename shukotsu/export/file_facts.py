"""What goes with every file: whose motion it is, what it was made from, what was done to it."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

from shukotsu.hand.posing import PosedRecording
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.subjects import SubjectSession, path_token

BONE_FRAME = (
    "-Z along the bone away from the wrist, +Y out of its back (of a thumb, the nail's side), +X = Y x Z "
    "(WebXR Hand Input)"
)


def file_stem(who: SubjectSession, hand: str, task: str, trial: str, model: str) -> str:
    """Return the name of a file without its extension: sub-01_hand-right_task-opposition_model-whole-hand.

    Names of any script stay; what a file name cannot hold becomes %XX (`shukotsu.study.study.path_token`).
    """
    parts = {"hand": hand, "task": task, "trial": trial, "model": model}
    named = [f"{key}-{path_token(value)}" for key, value in parts.items() if value]
    return "_".join([f"sub-{who.token}", *named])


def facts(motion: PosedRecording, unit: str, up: str, dropped: Sequence[str] = ()) -> dict[str, Any]:
    """Return facts about a file, in JSON types and a fixed order; no date and no absolute path.

    unit : of length. up : the axis that points up; empty in the transmitter's own frame.
    """
    origin, name = motion.origin, motion.origin.recording
    turned = f", turned so that {up} is up" if up else ""
    return {
        "program": f"{PROGRAM} {VERSION}",
        "subject": name.subject,
        **({"session": name.session} if name.session else {}),
        "hand": name.hand,
        "task": name.task,
        "trial": name.trial,
        "model": origin.model,
        "layout": origin.layout,
        "licence": origin.licence,
        "frames": len(motion.frame),
        "rate_hz": round(motion.rate_hz, 9) if isfinite(motion.rate_hz) else None,
        "length_unit": unit,
        "world": f"the transmitter's frame{turned}; motion is relative to the transmitter",
        "bone_frame": BONE_FRAME,
        "notes": list(motion.notes),
        "not_in_the_file": list(dropped),
        "inputs_sha256": dict(origin.inputs),
    }


def facts_text(motion: PosedRecording, unit: str, up: str, dropped: Sequence[str] = ()) -> str:
    """Return the same as lines of text, for formats that hold none themselves."""
    lines = []
    for key, value in facts(motion, unit, up, dropped).items():
        if isinstance(value, list):
            lines += [f"{key}: {sentence}" for sentence in value]
        elif isinstance(value, dict):
            lines += [f"{key}: {digest}  {name}" for name, digest in value.items()]
        elif value not in ("", None):
            lines.append(f"{key}: {value}")
    return "\n".join(lines) + "\n"
