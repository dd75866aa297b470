"""BIDS labels, which are letters and digits only, made of names that may be anything."""

from __future__ import annotations

import re

from shukotsu.schemas.poses import RecordingName

_ESCAPE = "Q"
"""The letter that English names need least; it starts the stand-in of whatever a label may not hold."""

_SHORT = {_ESCAPE: "Q", "_": "u", "-": "d", " ": "s", ".": "p"}


def label(name: str) -> str:
    """Turn a name into a label; no two names share one.

    ASCII letters other than Q and digits stand for themselves, Q for `QQ`, the blank for `Qs`, `_` `-` `.`
    for `Qu` `Qd` `Qp`, any other character for `Qx`, its code point in hexadecimal, and `x`.
    """
    return re.sub(r"[^A-PR-Za-z0-9]", lambda odd: _ESCAPE + _SHORT.get(odd[0], f"x{ord(odd[0]):x}x"), name)


def tracking_system(hand: str, model: str = "") -> str:
    """Give the tracksys label of a hand's receivers, or of its skeleton by a model; both hands differ."""
    return f"{label(hand)}hand" + (f"skeleton{label(model)}" if model else "")


def motion_folder(name: RecordingName) -> str:
    """Give the folder of a recording's files in its dataset."""
    session = f"ses-{label(name.session)}/" if name.session else ""
    return f"sub-{label(name.subject)}/{session}motion"


def recording_stem(name: RecordingName, model: str = "") -> str:
    """Give the part of a recording's file names before the suffix, its entities in the order of BIDS.

    A trial that is a number is the run; any other is the acquisition's label.
    """
    parts = [
        f"sub-{label(name.subject)}",
        *([f"ses-{label(name.session)}"] if name.session else []),
        f"task-{label(name.task)}",
        f"tracksys-{tracking_system(name.hand, model)}",
    ]
    if re.fullmatch(r"[0-9]+", name.trial):
        parts.append(f"run-{name.trial}")
    elif name.trial:
        parts.append(f"acq-{label(name.trial)}")
    return "_".join(parts)
