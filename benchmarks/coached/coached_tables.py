"""Tables of what the coach came to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.coached.hands import LONGEST_S, ROUTINE_S, STRICT_MM, WANTED_MM, Hand
from benchmarks.coached.session import Session
from benchmarks.two_drawings import FAR_MM, OTHER, OWN
from shukotsu.schemas.verdict import RADIUS_SD

STEP_S, SHARES = 0.5, (50, 90)
UNKNOWN_MM = 1000.0

Row = tuple[Cell, ...]


def groups(hands: Sequence[Hand]) -> Iterator[tuple[str, str, list[Hand]]]:
    """Give the hands by drawing and how their receivers were put on."""
    for drawing in (OWN, OTHER):
        for worn in ("right", "swapped"):
            own = [one for one in hands if (one.drawing, bool(one.swapped)) == (drawing, worn == "swapped")]
            if own:
                yield drawing, worn, own


def percentiles(sessions: Sequence[Session], joints: int, time_s: float) -> list[float]:
    """Give median and 90th percentile of all joints' errors, mm, as known at a time."""
    known = [session.at(time_s) for session in sessions]
    errors = [np.full(joints, UNKNOWN_MM) if own is None else own.error_mm for own in known]
    return [float(np.percentile(np.concatenate(errors), share)) for share in SHARES]


def time_table(hands: Sequence[Hand]) -> TextTable:
    """Compare the coach with the routine: when it is as good, and how good it is after as long."""
    rows: list[Row] = []
    times = np.arange(0.0, LONGEST_S + STEP_S, STEP_S).tolist()
    for drawing, worn, own in groups(hands):
        routine, joints = np.concatenate([hand.routine_mm for hand in own]), len(own[0].routine_mm)
        ends = [float(np.percentile(routine, share)) for share in SHARES]
        for asked_mm in (STRICT_MM, WANTED_MM):
            sessions = [hand.strict if asked_mm == STRICT_MM else hand.usual for hand in own]
            curve = {time_s: percentiles(sessions, joints, time_s) for time_s in times}
            took: list[Cell] = []
            for which in (0, 1):
                until = next((t for t, now in curve.items() if now[which] <= ends[which]), None)
                took += [until, None if until is None else 100 * until / ROUTINE_S]
            after = curve[ROUTINE_S]
            lower = 100 * (1 - after[1] / ends[1])
            rows.append((drawing, worn, len(own), asked_mm, *ends, *took, *after, lower))
    columns = (
        "drawing", "receivers", "hands:d", "asked mm:.1f", "routine: median:.2f", "p90:.2f",
        "s to median:.1f", "%:.0f", "s to p90:.1f", "%:.0f", "at 25 s: median:.2f", "p90:.2f", "lower %:.0f",
    )  # fmt: skip
    meaning = (
        f"Error of the worse half, mm, all joints of all hands. Routine: of {ROUTINE_S:.0f} s. Then the "
        "coach's newest estimates of all hands: when median and 90th percentile first are the routine's, in "
        "s and % of the routine, a swap's time included; what they are after as long, and by how much the "
        f"latter is lower. Who asks {STRICT_MM} mm goes on; at {WANTED_MM} mm what is enough stays as it is. "
        "Own: shares its anatomy with the estimator; other: shares nothing with it."
    )
    return TextTable("coached: the coach and the routine", columns, rows, meaning)


def enough_table(hands: Sequence[Hand]) -> TextTable:
    """Say what a hand is like when the coach says that it is enough, and what was found before."""
    rows: list[Row] = []
    for drawing, worn, own in groups(hands):
        enough = [(hand.usual, at_s) for hand in own for at_s in hand.usual.seconds_of("enough")[:1]]
        times = [float(np.percentile([at_s for _, at_s in enough] or [np.nan], q)) for q in SHARES]
        asked, anew = (
            sum(len(hand.usual.seconds_of(kind)) for hand in own) / len(own)
            for kind in ("asked", "put-right")
        )
        found = [(hand, *said) for hand in own for said in hand.usual.said if said[1] == "finding"]
        first = {id(hand): (at_s, all(name in what for name in hand.swapped or ("-",)))
                 for hand, at_s, _, what in reversed(found)}  # fmt: skip
        last_s, named = (
            max((at_s for at_s, _ in first.values()), default=None),
            sum(n for _, n in first.values()),
        )
        of = 100 / len(own)
        checks = (of * len(first), last_s, of * named, anew)
        rows.append((drawing, worn, of * len(enough), *times, asked, *_believed(enough), *checks))
    columns = (
        "drawing", "receivers", "enough %:.0f", "median s:.1f", "p90 s:.1f", "requests:.1f",
        "joints good %:.1f", f"> {FAR_MM:.0f} mm:d", "worst mm:.1f", "in 95 %:.1f",
        "finding %:.0f", "by s:.1f", "these two %:.0f", "begun anew:.1f",
    )  # fmt: skip
    meaning = (
        f"A study that asks {WANTED_MM} mm, at most {LONGEST_S:.0f} s; seconds from the first moment. Good: "
        "joints that the coach calls so when it first says that it is enough; of these, how many are far "
        "off, the worst, and how many in the stated radius. Finding: hands in which checks of the newest "
        "seconds find something, a false alarm where receivers are right; when the last hand's first came, "
        "and of how many it names the two that are swapped, neighbours on a digit for 10 s. Begun anew: how "
        "often the coach says that something was put right."
    )
    return TextTable("coached: when it is enough", columns, rows, meaning)


def _believed(enough: Sequence[tuple[Session, float]]) -> Row:
    known = [one for session, at_s in enough if (one := session.at(at_s)) is not None]
    if not any(one.believed.any() for one in known):
        return 0.0, 0, None, None
    believed, error, sd = (
        np.concatenate([getattr(one, name) for one in known]) for name in ("believed", "error_mm", "sd_mm")
    )
    own, inside = error[believed], (error <= RADIUS_SD * sd)[believed]
    return (
        100 * float(believed.mean()),
        int((own > FAR_MM).sum()),
        float(own.max()),
        100 * float(inside.mean()),
    )
