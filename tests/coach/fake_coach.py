"""A calibration as the coach would publish it: states and live poses of a stiff hand that turns."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from shukotsu.skeleton import rotations
from shukotsu.trackers.record.recording_terminal import Terminal

SHOWN_HZ = 30.0
DIGITS = ("thumb", "index", "middle", "ring", "little")
VERDICTS = (("believe", 1.2), ("care", 3.6), ("no", None))


class ReturnHeld(Terminal):
    """A terminal on which Return is held down."""

    def __init__(self) -> None:
        super().__init__(io.StringIO(), None)
        self.has_keys = True

    def pressed(self) -> str:
        """Give one more."""
        return "\r"


def hand_mm(hand: str) -> dict[str, Any]:
    """Give the wrist, and of every digit two joints and the tip, in the hand's frame: x distal, z dorsal."""
    aside = 1.0 if hand == "right" else -1.0
    found = {"wrist": np.array([-20.0, 0.0, -10.0])}
    for number, digit in enumerate(DIGITS):
        for x, part in zip((50.0, 80.0, 100.0), ("mcp", "pip", "tip"), strict=True):
            found[f"{digit}_{part}"] = np.array(
                [x - 30.0 * (number == 0), aside * (40.0 - 20.0 * number), -x / 9]
            )
    return found


def skeleton(hand: str) -> dict[str, Any]:
    """Give every point as the receiver of its name, 5 mm above it, carries it; the wrist's is `hand`."""
    names = list(hand_mm(hand))
    return {
        "points": names,
        "carried_by": ["hand", *names[1:]],
        "at_mm": [hand_mm(hand)["wrist"].tolist()] + [[0.0, 0.0, -5.0]] * (len(names) - 1),
        "lines": [[at - 1 if "mcp" not in name else 0, at] for at, name in enumerate(names) if at],
        "joint_of": ["" if name == "wrist" or name.endswith("tip") else name for name in names],
    }


def batch(hand: str, start: int, n: int = 7) -> tuple[list[float], Any]:
    """Give times and poses of n shown frames from the start-th on."""
    shown = np.arange(start, start + n)
    turned = rotations.about_axis(np.array([0.6, 0.0, 0.8]), 0.04 * shown)
    above = [np.zeros(3), *(at + np.array([0.0, 0.0, 5.0]) for at in list(hand_mm(hand).values())[1:])]
    poses = [np.concatenate([rotations.rotate(turned, at) + 200.0, turned], -1) for at in above]
    return (shown / SHOWN_HZ).tolist(), np.stack(poses, 1)


def state(time_s: float = 91.5, hand: str = "right", **changes: Any) -> dict[str, Any]:
    """Give a state in which every part says something; changes replace parts."""
    own = skeleton(hand)
    rows = zip(filter(None, own["joint_of"]), VERDICTS * 9, strict=False)
    flat = np.stack(list(hand_mm(hand).values()))
    request = {
        "number": 4,
        "sentence": "Bend the little fingertip alone; hold the middle joint with the other hand.",
        "times": 3,
        "seconds": 6.0,
        "joints": ["little_pip"],
        "drawing": [(flat * [1.0, spread, 1.0]).tolist() for spread in (0.8, 0.9, 1.0)],
    }
    return {
        "time_s": time_s,
        "phase": "calibrating",
        "title": {"study": "piano", "subject": "03", "hand": hand, "file": "03_rom.arrows", "since": "14:02"},
        "message": "",
        "findings": ["The receivers of ring_middle and ring_distal seem to be swapped."],
        "request": request,
        "done": {"number": 3, "sentence": "Index fingertip moved 41 deg.", "success": True},
        "joints": [
            {"joint": name, "name": f"joint {name}", "sd_mm": sd_mm, "verdict": verdict, "reason": ""}
            for name, (verdict, sd_mm) in rows
        ],
        "wanted_mm": 2.0,
        "settled": 4,
        "of": 10,
        "skeleton": own,
        "receivers": own["carried_by"],
        "log": [{"time_s": 4.0, "sentence": "Something was asked for."}],
        "marks": {"digits": list(DIGITS), "points": ["post"], "quantities": ["index_middle.lateral"]},
        "hands": [{"subject": subject, "hand": "right", "done": subject == "01"} for subject in ("01", "03")],
        "summary": None,
        **changes,
    }
