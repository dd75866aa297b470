"""The coach: it receives frames in the recording's order and returns lines of advice at every time step.

It uses neither a clock nor a file, so that the same frames give the same lines. The advice follows from the
fit's posterior: stated errors select the joint to move, and `gains` the measurement to take.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from shukotsu.checks.checked_recording import check_recording
from shukotsu.checks.hypotheses import Declared
from shukotsu.coach.live_poses import EvenFrames
from shukotsu.errors import InputError, count_of
from shukotsu.fit import hand_tables, loose_receivers
from shukotsu.fit.fingertips import Fingertips, fingertips
from shukotsu.fit.fit import FitSettings, fit_hand
from shukotsu.fit.gains import gains
from shukotsu.fit.measurements import Measurement
from shukotsu.hand.digit_chain import Rows
from shukotsu.report.belief import gain_lines, reasons_of
from shukotsu.study.findings import NOTE, in_quotes
from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel
from shukotsu.study.verdict import BELIEVE, judged_joint
from shukotsu.tables.poses import Poses, joined_poses

LEAST_FRAMES = 240
MOST_FITTED = 60
"""Largest number of frames in a fit: it takes a third less time than with a study's hundred, and stated
errors differ by at most 1 %."""


FINGERS = ("index", "middle", "ring", "little")
FIRST = "free"
"""Movement that is requested before the first estimate: the most informative one per time."""


@dataclass(frozen=True)
class Movement:
    """A movement to request. range_deg : range by joint. seconds : duration of two repetitions."""

    name: str
    sentence: str
    range_deg: Mapping[str, float]
    seconds: float = 5.0


def _bends_deg(fingers: tuple[str, ...] = FINGERS, **range_deg: float) -> dict[str, float]:
    return {f"{finger}_{kind}": deg for finger in fingers for kind, deg in range_deg.items()}


_WIDELY = _bends_deg(mcp=25, pip=30, dip=15) | {"thumb_cmc": 12, "thumb_mcp": 12, "thumb_ip": 12}
_ALL = (
    Movement(FIRST, "Move every finger and the thumb, each its own way, widely: bend, stretch and spread.",
             _WIDELY, 6.0),
    Movement("fist", "Close the hand to a fist and open it wide, twice.", _bends_deg(mcp=45, pip=55, dip=30)),
    Movement("hook", "Keep the knuckles straight; bend the fingers to a hook and stretch them, twice.",
             _bends_deg(pip=50, dip=30)),
    Movement("knuckles", "Keep the fingers straight; bend them at the knuckles, then draw them back, twice.",
             _bends_deg(mcp=50)),
    Movement("spread", "Keep the fingers straight; spread them apart and close them, twice.",
             _bends_deg(mcp=10)),
    *(Movement(f"fingertip-{finger}",
               f"Bend the {finger} fingertip alone; hold the middle joint with the other hand.",
               _bends_deg((finger,), dip=30), 4.0) for finger in FINGERS),
    *(Movement(f"alone-{finger}", f"Bend the {finger} finger alone, all of it, and stretch it, twice.",
               _bends_deg((finger,), mcp=40, pip=45, dip=25), 4.0) for finger in FINGERS),
    Movement("thumb-circle", "Draw a large circle with the thumb, from its base, both ways.",
             {"thumb_cmc": 25}, 6.0),
    Movement("thumb-middle", "Bend the thumb at its middle joint alone, and stretch it, twice.",
             {"thumb_mcp": 30}, 4.0),
    Movement("thumb-tip", "Bend the thumb's tip joint alone; hold the bone before it with the other hand.",
             {"thumb_ip": 35}, 4.0),
)  # fmt: skip
MOVEMENTS = {movement.name: movement for movement in _ALL}
"""All movements by name, with the ranges requested in docs/calibrate.md; the order decides between equals."""


@dataclass(frozen=True)
class CoachedHand:
    """A hand to calibrate, with the study's information on it.

    layout : layout of this hand, with the requested error. model : a model that fits the whole hand. whose :
    the hand's cells in the study's sheet, empty without a study. sizes_mm : measured SIZES, None if not
    measured.
    """

    hand: str
    layout: Layout
    model: SkeletonModel
    whose: Mapping[str, str] = field(default_factory=dict)
    sizes_mm: Mapping[str, float | None] = field(default_factory=dict)
    measurements: tuple[Measurement, ...] = ()


@dataclass(frozen=True)
class Estimate:
    """Estimate of the hand at time_s of the recording.

    rows : judged rows of joint_centres, for joints between two receivers.
    """

    time_s: float
    tips: Fingertips
    rows: Rows

    @property
    def open_sd_mm(self) -> dict[str, float]:
        """Errors (sd_mm) of the joints whose verdict is not yet "believe"."""
        return {joint: float(row["sd_mm"]) for joint, row in self.rows.items() if row["verdict"] != BELIEVE}


def estimate(coached: CoachedHand, poses: Poses) -> Estimate:
    """Fit the hand to all frames. Raises InputError if there are too few, or if they are not of a hand."""
    if len(poses.frame) < LEAST_FRAMES:
        count = count_of(len(poses.frame), "frame", "are")
        raise InputError(f"{count} too few for an estimate; expected {LEAST_FRAMES}")
    fitting = coached.model.fitting
    assert fitting is not None
    try:
        fit = fit_hand(
            [poses],
            coached.layout,
            coached.hand,
            **coached.sizes_mm,
            measurements=coached.measurements,
            settings=FitSettings(min(MOST_FITTED, fitting.frames), fitting.steps),
        )
        tips = fingertips(fit)
    except np.linalg.LinAlgError as error:
        raise InputError(f"the frames so far show no hand ({error})") from error
    solved = [row for row in hand_tables.joint_rows(fit) if row["joint"] in fit.joints]
    rows = {row["joint"]: judged_joint(row, coached.layout.wanted_mm) for row in solved}
    return Estimate(float(poses.time_s[-1]), tips, rows)


STEP_S = 1.5
CHECKED_S = 4.0
"""Duration of the newest frames that are checked like a recording, and interval of the checks."""
LOOSE_S = 15.0
"""Interval of the search for loose receivers, which takes as long as an estimate."""
LISTEN_S, PATIENCE = 1.0, 1.3
"""Time to read a request, and multiple of a movement's duration after which it counts as tried."""
WORTH, MOST_VAIN = 0.1, 2
"""A movement had no effect on a joint if it lowers its error by less than this share; after this many
movements without effect no more are requested for the joint."""
AGAIN = 1.1
"""After a sufficient calibration, factor by which a joint's error must exceed the requested one before more
movements are requested."""
LATE_S = 2.0
"""Delay of the waiting frames above which an estimate is skipped, on a slow machine."""
CHECKING, CALIBRATING, ENOUGH, ENDED = "checking", "calibrating", "enough", "ended"


@dataclass
class Request:
    """The current request, its time, and the errors of joints at that time."""

    movement: Movement
    began_s: float
    sd_mm: Mapping[str, float]


@dataclass
class Calibration:
    """State of a calibration since the recording began, or since a fault in it was corrected.

    kept : frames for estimates. newest : last frames, for checks. loose : a sentence for each loose receiver,
    by segment. vain : how often a movement did not improve a joint. done : movements that were tried.
    """

    began_s: float = 0.0
    kept: EvenFrames = field(default_factory=EvenFrames)
    newest: Poses | None = None
    estimate: Estimate | None = None
    request: Request | None = None
    loose: dict[str, str] = field(default_factory=dict)
    vain: Counter[str] = field(default_factory=Counter)
    done: set[str] = field(default_factory=set)


@dataclass
class Coach:
    """Coach of one hand's calibration.

    advice : current instruction. findings : current faults, a sentence each. log : all lines with their
    times. restarts : number of times that the calibration restarted after a fault was corrected.
    """

    hand: CoachedHand
    phase: str = CHECKING
    advice: str = ""
    findings: list[str] = field(default_factory=list)
    log: list[tuple[float, str]] = field(default_factory=list)
    restarts: int = 0
    time_s: float = 0.0
    frames: int = 0
    calibration: Calibration = field(default_factory=Calibration)
    _silent: tuple[tuple[str, ...], ...] = ()
    _next_s: float = STEP_S
    _check_s: float = CHECKED_S
    _loose_s: float = LOOSE_S

    def take(self, poses: Poses, *, may_leave_out: bool = False) -> list[str]:
        """Add frames; return the new lines.

        may_leave_out : whether to skip the estimate of a step if frames more than LATE_S later are waiting.
        """
        logged = len(self.log)
        while len(poses.frame):
            if poses.time_s[0] >= self._next_s:
                late = may_leave_out and poses.time_s[-1] - self._next_s > LATE_S
                if self.calibration.newest is not None:
                    self._step(self._next_s, late=late)
                self._next_s = float((poses.time_s[0] // STEP_S + 1) * STEP_S)
            rows = int(np.searchsorted(poses.time_s, self._next_s))
            self._add(poses.take(slice(0, rows)))
            poses = poses.take(slice(rows, None))
        return self._lines(logged)

    def end(self) -> list[str]:
        """Estimate once more, from all frames; return the result of the calibration as lines."""
        logged = len(self.log)
        if self.phase == CHECKING and self.calibration.newest is not None:
            self._check()
        self._estimate()
        self.phase, self.calibration.request, self.advice = ENDED, None, ""
        self._say(self.summary())
        return self._lines(logged) + joint_lines(self.calibration.estimate)

    def summary(self) -> str:
        """Summarise the calibration and what would improve it."""
        if self.findings:
            return f"Not calibrated: {self.findings[0]}"
        if self.calibration.estimate is None:
            return f"Not calibrated: {count_of(self.frames, 'frame', 'show')} no hand yet."
        left, seconds = self.calibration.estimate.open_sd_mm, self.time_s - self.calibration.began_s
        n_joints = len(self.calibration.estimate.rows)
        text = f"{n_joints - len(left)} of {count_of(n_joints, 'joint')} good enough after {seconds:.0f} s"
        if not left:
            return f"{text}."
        text += "; left are " + ", ".join(f"{joint} at {sd_mm:.2f} mm" for joint, sd_mm in left.items())
        return " ".join([f"{text}.", *(f"What would help: {line}" for line in self.gains()[:1])])

    def gains(self) -> list[str]:
        """Return the gains of further measurements, the best first, in the report's words."""
        return [] if self.calibration.estimate is None else gain_lines(gains(self.calibration.estimate.tips))

    def _add(self, poses: Poses) -> None:
        now = self.calibration
        self.time_s = float(poses.time_s[0])
        if now.request is None and now.estimate is None and not self.findings:
            self._ask(MOVEMENTS[FIRST], {})
        now.kept.add(poses)
        self.frames += len(poses.frame)
        self.time_s = float(poses.time_s[-1])
        newest = poses if now.newest is None else joined_poses([now.newest, poses])
        now.newest = newest.take(slice(int(np.searchsorted(newest.time_s, self.time_s - CHECKED_S)), None))

    def _step(self, time_s: float, *, late: bool) -> None:
        now = self.calibration
        self.time_s = time_s
        if time_s >= self._check_s:
            self._check_s = time_s + CHECKED_S / (2 if self.findings else 1)
            self._check()
        if late or self.findings or self.phase == CHECKING:
            return
        self._estimate()
        if now.estimate is not None:
            self._advise(now.estimate)
            if time_s >= self._loose_s:
                self._loose_s = time_s + LOOSE_S
                before, now.loose = now.loose, {}
                for moved in loose_receivers.displaced_in(now.estimate.tips.fit, [now.kept.poses()]).loose:
                    now.loose[moved.segment] = (
                        f"The receiver on {moved.segment} moved by {moved.shift_mm:.1f} mm and "
                        f"{moved.turn_deg:.0f} deg at {moved.start.time_s:.0f} s: tape it anew, end and "
                        "start again."
                    )
                    if moved.segment not in before:
                        self._say(now.loose[moved.segment])

    def _check(self) -> None:
        """Check the newest frames like a recording; findings suspend the requests."""
        assert self.calibration.newest is not None
        poses, layout, before = self.calibration.newest, self.hand.layout, self._silent
        checked = check_recording(poses, layout, self.hand.hand, Declared(kind="device"))
        wrong = [each for each in checked.findings if each.severity != NOTE and each.kind != "too-short"]
        seen = np.asarray(poses.valid.any(0))
        silent = [name for name in layout.expected if not seen[poses.index(name)]]
        self._silent = (*((each.kind, each.variant) for each in wrong), *((name,) for name in silent))
        if self._silent == before and self.findings:
            return  # the same faults: do not repeat them only because their numbers changed
        self.findings = [str(in_quotes(each.message)) for each in wrong]
        self.findings += [f"Nothing comes from the receiver on {name}: is it connected?" for name in silent]
        if self.findings:
            self.phase, self.calibration.request = CHECKING, None
            self.advice = "Correct this; the calibration restarts as soon as nothing is wrong."
            for finding in self.findings:
                self._say(finding)
        elif before:
            self._say("Corrected. The calibration restarts; what was recorded before is not used.")
            self.restarts += 1
            self.calibration, self.advice = Calibration(began_s=self.time_s), ""
            self._check_s = self.time_s + CHECKED_S
        elif self.phase == CHECKING:
            self.phase = CALIBRATING
            self._say(f"Nothing is wrong in these {CHECKED_S:.0f} s: receivers, hand, units.")

    def _estimate(self) -> None:
        now = self.calibration
        if self.findings or now.newest is None:
            return
        before = None if now.estimate is None else now.estimate.open_sd_mm.keys()
        try:
            now.estimate = estimate(self.hand, now.kept.poses())
        except InputError as error:
            if not self.log or "No estimate" not in self.log[-1][1]:
                self._say(f"No estimate yet: {error}.")
            return
        n_joints, left = len(now.estimate.rows), now.estimate.open_sd_mm
        if left and left.keys() != before:
            worst = max(left, key=lambda joint: left[joint])
            self._say(
                f"{n_joints - len(left)} of {count_of(n_joints, 'joint')} good enough; the least certain is "
                f"{worst} at {left[worst]:.2f} mm"
            )

    def _advise(self, current: Estimate) -> None:
        """Request the most useful movement once the current one is done or was tried, or report "enough"."""
        now, before, wanted_mm = self.calibration, self.phase, self.hand.layout.wanted_mm
        if before == ENOUGH:
            worst_mm = max(self._useful(current).values(), default=0.0)
            if worst_mm <= AGAIN * wanted_mm:
                return
            self.phase = CALIBRATING
        if now.request is not None:
            if not self._is_over(now.request, current):
                return
            for joint in now.request.movement.range_deg.keys() & now.request.sd_mm.keys():
                now.vain[joint] += current.rows[joint]["sd_mm"] > (1 - WORTH) * now.request.sd_mm[joint]
            now.done.add(now.request.movement.name)
        weight = {joint: sd_mm - wanted_mm for joint, sd_mm in self._useful(current).items()}
        rates = {
            name: sum(weight.get(joint, 0.0) for joint in movement.range_deg) / (movement.seconds + LISTEN_S)
            for name, movement in MOVEMENTS.items()
            if name not in now.done and weight.keys() & movement.range_deg.keys()
        }
        if rates:
            self._ask(MOVEMENTS[max(rates, key=lambda name: rates[name])], current.open_sd_mm)
            return
        self.phase, now.request = ENOUGH, None
        self.advice = f"Enough: {self.summary()}"
        if before != ENOUGH:  # report it once; afterwards only its numbers change
            self._say(self.advice)

    def _useful(self, current: Estimate) -> dict[str, float]:
        """Return the errors (sd_mm) of joints that are not good enough and that movements may improve."""
        vain = self.calibration.vain
        return {joint: sd_mm for joint, sd_mm in current.open_sd_mm.items() if vain[joint] < MOST_VAIN}

    def _is_over(self, request: Request, current: Estimate) -> bool:
        """Return whether a movement is done, judged by the joints that need it, or has timed out."""
        movement, elapsed_s = request.movement, self.time_s - request.began_s
        needed = movement.range_deg.keys() & current.open_sd_mm.keys()
        shown = all(current.rows[joint]["range_deg"] >= movement.range_deg[joint] for joint in needed)
        waited_s = movement.seconds if shown else PATIENCE * movement.seconds + LISTEN_S
        return not needed or elapsed_s >= waited_s

    def _ask(self, movement: Movement, sd_mm: Mapping[str, float]) -> None:
        self.calibration.request = Request(movement, self.time_s, sd_mm)
        self.advice = movement.sentence
        self._say(f">> {movement.sentence}")

    def _say(self, line: str) -> None:
        self.log.append((self.time_s, line))

    def _lines(self, logged: int) -> list[str]:
        return [f"{time_s:7.1f} s  {line}" for time_s, line in self.log[logged:]]


def joint_lines(current: Estimate | None) -> list[str]:
    """Format every joint with its stated error and verdict, one line per joint."""
    return [
        f"{row['joint']:<14} {row['sd_mm']:6.2f} mm  {row['verdict']:<8} {first_reason(row)}".rstrip()
        for row in (current.rows.values() if current else ())
    ]


def first_reason(row: Mapping[str, object]) -> str:
    """Return the first reason why a joint is not believed, or "" if it is."""
    return "" if row["verdict"] == BELIEVE else next(iter(reasons_of(row)), "")
