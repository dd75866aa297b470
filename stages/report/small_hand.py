"""A hand as small as a letter's height: its bones as long as the tables say, its joints by verdict."""

from __future__ import annotations

import math
from collections import defaultdict

from markupsafe import Markup

from shukotsu.schemas.study import Hand
from shukotsu.schemas.verdict import VERDICTS
from shukotsu.sentences.translation import tr, word
from shukotsu.stages.report.study_results import StudyResults

_FAN_DEG = {"thumb": 48.0, "index": 12.0, "middle": 2.0, "ring": -8.0, "little": -19.0}
"""Which way a digit of a right hand points from the wrist, from straight on towards the thumb."""
_WRIST_MM, _USUAL_MM = 30.0, 25.0
"""From the wrist to where a first bone starts, where no bone says it; a bone whose length is not known."""


def small_hand(results: StudyResults, hand: Hand, model: str) -> Markup:
    """Return the hand from its back as SVG: a schema, in which only lengths and verdicts are the tables'."""
    lengths = {(row["digit"], row["bone"]): row for row in results.bones_of.get((hand, model), [])}
    verdicts = {row["joint"]: row["verdict"] for row in results.joints_of.get((hand, model), [])}
    layout = results.layouts[hand]
    wrist = layout.wrist.joint if layout.wrist else None
    places: dict[str, tuple[float, float]] = {wrist: (0.0, 0.0)} if wrist else {}
    lines = []
    side = 1.0 if hand.hand == "right" else -1.0
    for index, (name, digit) in enumerate(layout.digits.items()):
        angle = math.radians(_FAN_DEG.get(name, 10.0 * index))
        right, up = -side * math.sin(angle), -math.cos(angle)
        bones = [lengths.get((name, bone), {}) for bone in digit.segments]
        starts = bones[0].get("starts_at", "") if layout.is_hand else wrist
        reach, line = 0.0 if starts == wrist else _WRIST_MM, [(0.0, 0.0)]
        for joint, bone in zip(digit.joints, bones, strict=True):
            line.append((right * reach, up * reach))
            places.setdefault(joint, line[-1])
            reach += bone.get("length_mm") or _USUAL_MM
        lines.append([*line, (right * reach, up * reach)])
    dots = defaultdict(list)
    for joint, place in places.items():
        if joint in verdicts:
            dots[verdicts[joint]].append(place)
    paths = [("bones", "".join("M" + "L".join(map(_text, line)) for line in lines))]
    paths += [(own, "".join(f"M{_text(place)}h0" for place in dots[own])) for own in VERDICTS if dots[own]]
    title = tr("{hand} hand of {who}, joints by verdict", hand=word(hand.hand), who=hand.who.label)
    inside = Markup("").join(Markup('<path class="{}" d="{}"/>').format(*path) for path in paths)
    across, down = zip(*(place for line in lines for place in line), strict=True)
    box = (min(across) - 8, min(down) - 8, max(across) - min(across) + 16, max(down) - min(down) + 16)
    size = " ".join(f"{length:.0f}" for length in box)
    return Markup('<svg viewBox="{}" role="img"><title>{}</title>{}</svg>').format(size, title, inside)


def _text(place: tuple[float, float]) -> str:
    return f"{place[0]:.0f} {place[1]:.0f}"
