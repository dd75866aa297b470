"""The coach itself: frames and events go in, in the archive's order; a state comes out at every tick of the
recording's time.

It knows neither a clock nor a file, so the same frames and events give the same states, live and from the
archive afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shukotsu.checks.checked_recording import check_recording
from shukotsu.checks.declared import Declared
from shukotsu.coach import wording
from shukotsu.coach.board import checked_entry
from shukotsu.coach.drawn_hand import drawn
from shukotsu.coach.estimate import HELD_S, Estimate, MarkedTouch, estimate
from shukotsu.coach.expected_gains import imagined_states
from shukotsu.coach.live_poses import Arrived, EvenFrames
from shukotsu.coach.movements import MOVEMENTS, Movement
from shukotsu.coach.progress import POSED_HZ, Progress
from shukotsu.coach.requests import LISTEN_S, MOVEMENT, TOUCHING, Option, choose
from shukotsu.coach.setup import KIND, CoachSetup, check_names
from shukotsu.errors import InputError
from shukotsu.schemas.findings import NOTE
from shukotsu.schemas.poses import Poses
from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.loose_receivers import displaced_in
from shukotsu.stages.fit_hand.measurements import Measurement
from shukotsu.stages.fit_hand.receiver_frames import concatenated
from shukotsu.stages.fit_hand.touches import CONTACT_SD_MM, TOUCH_SD_MM

TICK_S = 0.5
ESTIMATE_TICKS = 3
FIRST_ESTIMATE_S = 3.0
CHECKED_S = 4.0
"""Of the newest frames, that are checked together as a recording is; and how often, twice as often while
something is wrong.
"""

LOOSE_S = 15.0
"""How often it is looked for receivers that came loose, which takes as long as an estimate; as checks are, it
is between two of them.
"""

MOST_ASKED = 3
AGAIN = 1.1
"""After it was enough a joint's error must be so many times what is wanted for more to be asked for."""

SOONEST_S = 1.0
"""Nobody has done anything of a request before."""

PATIENCE = 1.3
"""So many times as long as a request takes is waited until it counts as tried."""

FIRST = "free"
"""The request that is made before anything is known."""

WAITING, CHECKING, CALIBRATING, ENOUGH, ENDED = "waiting", "checking", "calibrating", "enough", "ended"


@dataclass
class Request:
    """What was asked for last: number, option, when, how often, and what was seen of it."""

    number: int
    option: Option
    began_s: float
    times: int = 1
    progress: Progress = field(default_factory=Progress)
    drawing: list[list[list[float]]] | None = None


@dataclass
class Coach:
    """One hand's calibration.

    skipped : numbers of ticks at which no estimate is made, as a machine that was too slow made none;
    leaves_out : whether this machine is too slow for an estimate at a tick and its time.
    """

    setup: CoachSetup
    skipped: set[int] = field(default_factory=set)
    leaves_out: Callable[[int, float], bool] = lambda *_: False

    def __post_init__(self) -> None:
        self.layout = self.setup.layout_of_hand()
        self.known: Estimate | None = None
        self.request: Request | None = None
        self.phase = WAITING
        self.findings: list[Mapping[str, Any]] = []
        self.log: list[tuple[float, Mapping[str, Any]]] = []
        self.done: Mapping[str, Any] | None = None
        self.loose: list[Mapping[str, Any]] = []
        self.restarts = 0
        self.left: list[Mapping[str, Any]] = []
        self.enough_s: float | None = None
        self.began_s = 0.0
        self.time_s = 0.0
        self._frames, self._newest = EvenFrames(), list[Poses]()
        self._host_ns: list[tuple[np.ndarray, np.ndarray]] = []
        self._asked: dict[str, int] = {}
        self._refused: set[str] = set()
        self._not_used: set[str] = set()
        self._since: dict[str, float] = {}
        self._gains: dict[str, Array] = {}
        self.measured: list[Measurement] = []
        self.touches: list[MarkedTouch] = []
        self._order: list[str] = []
        self._number = self._tick = 0
        self._next_check_s, self._next_loose_s = CHECKED_S, LOOSE_S

    def take(self, arrived: Arrived | None, marks: Sequence[Mapping[str, Any]] = ()) -> list[dict[str, Any]]:
        """Take frames and marks that came; give the states of the ticks that are over."""
        for mark in marks:
            self._mark(mark)
        states: list[dict[str, Any]] = []
        if self.phase == ENDED:
            return states
        while arrived is not None and len(arrived.poses.frame):
            over = (self._tick + 1) * TICK_S
            if arrived.poses.time_s[0] > over + CHECKED_S:  # nothing came: there is nothing to look at
                self._pass_over(float(arrived.poses.time_s[0]))
                continue
            rows = int(np.searchsorted(arrived.poses.time_s, over))
            self._add(arrived.poses.take(slice(0, rows)), arrived.host_ns[:rows])
            if rows == len(arrived.poses.frame):
                break
            arrived = Arrived(arrived.poses.take(slice(rows, None)), arrived.host_ns[rows:])
            if self._newest:
                states.append(self._over(over))
            self._tick += 1
        return states

    def _add(self, poses: Poses, host_ns: Any) -> None:
        if not len(poses.frame):
            return
        self._frames.add(poses)
        self._newest.append(poses)
        self._host_ns.append((host_ns, poses.frame))
        self.touches = [touch.held_in(host_ns, poses.frame) for touch in self.touches]
        while self._newest[0].time_s[-1] < poses.time_s[-1] - CHECKED_S:
            self._newest.pop(0)
            self._host_ns.pop(0)
        if self.known is not None and self.request is not None:
            step = max(1, round(_rate_hz(poses) / POSED_HZ))
            self.request.progress.add(self.known, poses.take(slice(None, None, step)))

    def _pass_over(self, time_s: float) -> None:
        """Go on where frames come again after a gap, and let the request wait for as long."""
        ticks = int(time_s / TICK_S) - self._tick
        ticks -= ticks % ESTIMATE_TICKS
        self._tick += ticks
        self._newest, self._host_ns = [], []
        if self.request is not None:
            self.request.began_s += ticks * TICK_S

    def _over(self, time_s: float) -> dict[str, Any]:
        """What a tick brings: a check, an estimate, what is seen of the request, the next one."""
        self.time_s = time_s
        if self.phase in (WAITING, CHECKING) and self.request is None and not self.findings:
            self.phase = CHECKING
            self._ask(Option(MOVEMENT, FIRST, MOVEMENTS[FIRST].seconds, np.zeros(0)))
        of_three = self._tick % ESTIMATE_TICKS
        if time_s >= self._next_check_s and (of_three == 1 or self.phase == CHECKING):
            self._check()
            self._next_check_s = time_s + (CHECKED_S / 2 if self.findings else CHECKED_S)
        if not self.findings and self.phase != CHECKING:
            if of_three == 0 and time_s - self.began_s >= FIRST_ESTIMATE_S:
                late = self.known is not None and self.leaves_out(self._tick, time_s)
                if not late and self._tick not in self.skipped:
                    self._estimate()
            elif of_three == 2 and time_s >= self._next_loose_s and self.known is not None:
                self._next_loose_s = time_s + LOOSE_S
                self._look_for_loose(self.known)
            self._follow()
        return self.state()

    def _check(self) -> None:
        """Check the newest frames as a recording is checked; what is found stops the asking until it is put
        right.
        """
        poses = concatenated(self._newest)
        checked = check_recording(poses, self.layout, self.setup.hand, Declared(kind="device"))
        found = [
            finding
            for finding in checked.findings
            if finding.severity != NOTE and finding.kind != "too-short"
        ]
        seen = np.asarray(poses.valid.any(0))
        silent = [own for own in self.layout.expected if not seen[poses.index(own)]]
        before = self.findings
        self.findings = [{"kind": "finding", "finding": finding} for finding in found]
        self.findings += [{"kind": "silent", "segment": segment} for segment in silent]
        if list(map(_what, before)) == list(map(_what, self.findings)):
            self.findings = before  # the same: its numbers need not change before somebody's eyes
        for own in self.findings if self.findings is not before else ():
            self._say(own)
        if self.findings:
            self.request = None
            self.phase = CHECKING
        elif before:
            self._say({"kind": "put-right"})
            self._begin_anew()
        elif self.phase == CHECKING:
            self.phase = CALIBRATING

    def _begin_anew(self) -> None:
        """Forget what came before something was put right, also of the newest frames: receivers sit elsewhere
        now.
        """
        self.restarts += 1
        self._frames, self._newest, self._host_ns = EvenFrames(), [], []
        self.known, self.request, self.done, self.phase = None, None, None, WAITING
        self._asked, self._refused, self._since, self.touches, self.loose = {}, set(), {}, [], []
        self._order, self._not_used = [own for own in self._order if own != TOUCHING], set()
        self.began_s, self.enough_s = self.time_s, None

    def _estimate(self) -> None:
        try:
            self.known = estimate(self.setup, self.layout, self._frames.poses(), self.measured, self.touches)
        except InputError as error:
            self._say({"kind": "no-estimate", "reason": str(error)})
            return
        self._since, self._gains = {}, {}
        not_used = {reason.split(" is ")[0]: reason for reason in self.known.tips.refused}
        for name in sorted(not_used.keys() - self._not_used):
            self._say({"kind": "not-used", "reason": not_used[name]})
        self._not_used = {*not_used}
        if self.request is not None and self.request.drawing is None:
            self.request.drawing = self._drawing(self.request.option)

    def _look_for_loose(self, known: Estimate) -> None:
        displaced = displaced_in(known.fit, [self._frames.poses()])
        was = {one["segment"] for one in self.loose}
        self.loose = [
            {
                "kind": "loose",
                "segment": one.segment,
                "mm": one.shift_mm,
                "deg": one.turn_deg,
                "time_s": one.start.time_s,
            }
            for one in displaced.loose
        ]
        for one in self.loose:
            if one["segment"] not in was:
                self._say(one)

    def _follow(self) -> None:
        """See whether the request is done, tried or to be waited for; ask for the next one."""
        if self.known is None:
            return
        if self.phase == ENOUGH and not self._is_worse(self.known):
            return
        if self.request is None or not self.known.open_joints:
            self._next()
            return
        request, elapsed_s = self.request, self.time_s - self.request.began_s
        if request.option.kind != MOVEMENT:
            if elapsed_s > PATIENCE * request.option.seconds * MOST_ASKED:
                self._give_up(request)
            return
        movement = MOVEMENTS[request.option.name]
        could_be_done = request.progress.is_done(movement) and elapsed_s >= 0.5 * movement.seconds
        if could_be_done or elapsed_s > LISTEN_S + PATIENCE * movement.seconds * request.times:
            self._look_at(request, movement)

    def _is_worse(self, known: Estimate) -> bool:
        """Say whether a joint that was good enough is clearly no more, after it was said to be enough."""
        left = {own["joint"] for own in self.left}
        sd_mm = {name: float(known.rows[name]["sd_mm"]) for name in known.open_joints if name not in left}
        return any(own > AGAIN * self.setup.wanted_mm for own in sd_mm.values())

    def _tried(self, request: Request, movement: Movement, elapsed_s: float) -> None:
        joint, moved_deg, wanted_deg = request.progress.least(movement)
        seen = {
            "number": request.number,
            "joint": joint,
            "deg": moved_deg,
            "wanted_deg": wanted_deg,
            "name": movement.name,
        }
        if self._asked[movement.name] >= MOST_ASKED:
            self.done = {**seen, "kind": "gave-up"}
            self._refused.add(movement.name)
            self._finish(request, elapsed_s)
            return
        best = self._best()
        if best is None or best.name != movement.name:  # what was done of it has brought what it can
            self.done = {**seen, "kind": "done"}
            self._finish(request, elapsed_s)
            return
        instead = request.progress.instead(movement)
        self.done = {**seen, "kind": "instead", "other": instead} if instead else {**seen, "kind": "further"}
        self._say(self.done)
        self._asked[movement.name] += 1
        request.times += 1

    def _finish(self, request: Request, elapsed_s: float) -> None:
        assert self.done is not None
        self._say(self.done)
        if request.option.kind == MOVEMENT:
            seconds = min(elapsed_s, 2 * request.option.seconds)
            self._since[request.option.name] = self._since.get(request.option.name, 0.0) + seconds
        self._next()

    def _give_up(self, request: Request) -> None:
        self._refused.add(request.option.name)
        self.done = {"number": request.number, "kind": "skipped", "name": request.option.name}
        self._say(self.done)
        self._next()

    def _next(self) -> None:
        """Choose the next request, or say that it is enough."""
        option = self._best()
        if option is None and self._since and self.known is not None and self.known.open_joints:
            self.request = None  # the next estimate says what the last movement brought
            return
        if option is None:
            if self.phase != ENOUGH:
                self.phase, self.enough_s = ENOUGH, self.time_s
                self.left = self.summary()["left"]
                if self.done is not None and self.done["kind"] not in ("done", "entered"):
                    self.done = None  # nothing is to be done any further
                self._say({"kind": "enough", **self.summary()})
            self.request = None
            return
        self.phase = CALIBRATING
        self._ask(option)

    def _best(self) -> Option | None:
        """Give what would help most now; None where nothing would, or nothing need."""
        if self.known is None or not self.known.open_joints:
            return None
        refused = self._refused | {name for name, times in self._asked.items() if times >= MOST_ASKED}
        return choose(self.setup, self.known, refused, self._since, self._gains)

    def _ask(self, option: Option) -> None:
        self._number += 1
        if self.done is not None and self.done["kind"] == "done" and self.done["name"] == option.name:
            self.done = {**self.done, "kind": "again"}
        self._asked[option.name] = self._asked.get(option.name, 0) + 1
        self.request = Request(self._number, option, self.time_s, drawing=self._drawing(option))
        self._say({"kind": "asked", "option": option.kind, "name": option.name})

    def _drawing(self, option: Option) -> list[list[list[float]]] | None:
        """Postures of a movement as the hand that is known does it; None before it is."""
        if self.known is None or option.kind != MOVEMENT:
            return None
        states = imagined_states(self.known.fit, MOVEMENTS[option.name])
        return drawn(self.known.tips, states)

    def _mark(self, mark: Mapping[str, Any]) -> None:
        """Take what somebody entered: a touch, a length, or a word on the request.

        What an archive has that nobody could have entered is left out.
        """
        if mark.get("kind") in (KIND, "stop"):
            return
        entry = {name: mark[name] for name in mark if name not in ("event", "host_ns")}
        try:
            entry = checked_entry({"kind": "done"} if entry.get("kind") == "button" else entry)
            check_names(entry, self.layout, self.setup)
        except InputError:
            return
        obeyed = self._obey(entry, int(mark["host_ns"]))
        if obeyed is not None:
            self._say({**obeyed, "kind": "mark", "what": obeyed["kind"]})

    def _obey(self, entry: Mapping[str, Any], host_ns: int) -> Mapping[str, Any] | None:
        """Do what an entry says; give what it came to, None where there was nothing to do."""
        kind, request = entry["kind"], self.request
        if kind == "touch":
            if not self._touch(entry, host_ns):
                return None
        elif kind == "length":
            self._length(entry)
        elif kind == "undo":
            return entry if self._undo() else None
        elif kind == "finish":
            self.phase = ENDED
        elif kind in ("done", "skip"):
            if request is None or self.known is None or not self._is_meant(entry):
                return None
            if kind == "skip":
                self._give_up(request)
            elif self.time_s - request.began_s < SOONEST_S:
                return None
            elif request.option.kind == MOVEMENT:
                self._look_at(request, MOVEMENTS[request.option.name])
            elif request.option.kind == TOUCHING:
                held = {"kind": "touch", "digit": request.option.name, "part": "tip"}
                return self._obey({**held, "point": next(iter(self.setup.points))}, host_ns)
        if kind in ("touch", "length") and request is not None and self.known is not None:
            name = str(entry.get("quantity", entry.get("digit")))
            if request.option.name == name:
                self._refused.add(name)
                self.done = {"number": request.number, "kind": "entered", "name": name}
                self._finish(request, 0.0)
        return entry

    def _look_at(self, request: Request, movement: Movement) -> None:
        """See whether a movement is done, that may be."""
        elapsed_s = self.time_s - request.began_s
        if request.progress.is_done(movement):
            self.done = {"number": request.number, "kind": "done", "name": movement.name}
            self._finish(request, elapsed_s)
        else:
            self._tried(request, movement, elapsed_s)

    def _length(self, entry: Mapping[str, Any]) -> None:
        self.measured = [own for own in self.measured if own.quantity != entry["quantity"]]
        self.measured.append(Measurement(entry["quantity"], float(entry["value_mm"]), float(entry["sd_mm"])))
        self._order = [own for own in self._order if own != entry["quantity"]] + [entry["quantity"]]

    def _undo(self) -> bool:
        """Take the last touch or length back, and let it be asked for again."""
        if not self._order:
            return False
        last = self._order.pop()
        if last == TOUCHING:
            self._refused.discard(self.touches.pop().digit)
        else:
            self.measured = [own for own in self.measured if own.quantity != last]
            self._refused.discard(last)
        return True

    def _is_meant(self, mark: Mapping[str, Any]) -> bool:
        """Say whether a word is on the request that stands, and not on one that has just gone."""
        number = None if self.request is None else self.request.number
        return number is not None and str(mark.get("number", number)) == str(number)

    def _touch(self, entry: Mapping[str, Any], host_ns: int) -> bool:
        """Take a touch; tell whether it is one, and not the last one's switch that bounced."""
        if self.touches and abs(host_ns - self.touches[-1].host_ns) < 2 * HELD_S * 1e9:
            return False
        meets = str(entry.get("meets", ""))
        x, y, z, sd_mm = self.setup.points.get(str(entry.get("point", "")), (0.0, 0.0, 0.0, TOUCH_SD_MM))
        touch = MarkedTouch(
            np.zeros(0, np.int64),
            host_ns,
            str(entry["digit"]),
            "pad" if meets else str(entry.get("part", "tip")),
            meets,
            None if meets else (x, y, z),
            CONTACT_SD_MM if meets else sd_mm,
        )
        for came_ns, frame in self._host_ns:
            touch = touch.held_in(came_ns, frame)
        self.touches.append(touch)
        self._order.append(TOUCHING)
        return True

    def _say(self, what: Mapping[str, Any]) -> None:
        self.log.append((self.time_s, what))

    def summary(self) -> dict[str, Any]:
        """Give what the calibration came to: seconds, joints left and why, as JSON types."""
        left = [] if self.known is None else self.known.open_joints
        rows = {} if self.known is None else self.known.rows
        return {
            "seconds": round((self.enough_s or self.time_s) - self.began_s, 1),
            "left": [left_row(rows[name]) for name in left],
            "believed": len(rows) - len(left),
            "of": len(rows),
        }

    def state(self) -> dict[str, Any]:
        """Give the state that the faces show (see the module `wording`)."""
        return wording.state_of(self)


def left_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Say of a judged row of a joint that is left why it is, in JSON types."""
    rounded = {name: round(float(row[name]), digits) for name, digits in (("sd_mm", 2), ("range_deg", 1))}
    return {name: row[name] for name in ("joint", "reason", "reason_values")} | rounded


def _what(finding: Mapping[str, Any]) -> tuple[str, ...]:
    """Say what is found, without its numbers."""
    own = finding.get("finding")
    return (finding["segment"],) if own is None else (own.kind, own.variant)


def _rate_hz(poses: Poses) -> float:
    span_s = float(poses.time_s[-1] - poses.time_s[0])
    return (len(poses.time_s) - 1) / span_s if span_s > 0 else POSED_HZ
