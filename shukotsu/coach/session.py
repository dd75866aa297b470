"""Run the coach on an archive: one thread reads, decodes and shows live poses; this one thinks, and shows
what it thinks.

Neither ever writes to the archive: what is entered goes to the recorder (`send`) and comes back with the
frames; it is put into the archive at its end.
"""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TextIO

import numpy as np

from shukotsu.coach.board import Board, checked_entry
from shukotsu.coach.coach import ENDED, Coach
from shukotsu.coach.live_poses import Arrived, LivePoses
from shukotsu.coach.setup import LEFT_OUT, check_names, names_of
from shukotsu.errors import InputError
from shukotsu.sentences.translation import tr
from shukotsu.trackers.archive import Piece

if TYPE_CHECKING:
    from shukotsu.coach.terminal_face import TerminalFace

SHOWN_HZ = 30.0
READ_S = 0.1
LISTEN_S = 0.05
LOST_S, FIRST_S = 5.0, 15.0
"""How often it is said that nothing comes; and when first, where a tracker is still being set up."""

MOST_WAITING = 1024
"""Pieces that wait for the estimate, some minutes, before reading pauses: the file keeps them."""

BEHIND_S = 2.0
"""An estimate is left out where frames wait that are so much later: of a machine that is slow, or busy."""

REST_S = 5.0
_Came = tuple[Arrived | None, list[Mapping[str, Any]]]


class Source(Protocol):
    """Where pieces of an archive come from."""

    @property
    def ended(self) -> bool:
        """Say whether no more will come."""

    def read(self) -> list[Piece]:
        """Give what came since the last call."""


@dataclass
class Session:
    """One archive, coached. send : hands an entry to the recorder; None where nobody records for this
    program. may_leave_out : whether estimates are left out where they would come late.

    title : what the faces show of whose hand it is. log : every state as a line of JSON, without what hangs
    on the clock. oldest_s : the greatest age that an estimate reached before the next one came.
    """

    coach: Coach
    source: Source
    board: Board
    face: TerminalFace
    title: Mapping[str, Any]
    send: Callable[[Mapping[str, Any]], None] | None = None
    hands: Sequence[Mapping[str, Any]] = ()
    log: TextIO | None = None
    ending: Callable[[], str] = str
    may_leave_out: bool = True
    oldest_s: float = 0.0
    frames: int = 0
    _stop: threading.Event = field(default_factory=threading.Event)
    _failed: Exception | None = None
    _heard: float = 0.0
    _state: Mapping[str, Any] = field(default_factory=dict)
    _showing: threading.Lock = field(default_factory=threading.Lock)
    _lost: int = 0
    _finish: bool = False
    _newest_s: float = 0.0

    def run(self, stopped: Callable[[], bool]) -> None:
        """Coach until the archive ends, somebody ends the calibration, or `stopped`; where this program
        records, until receivers were put right too: then the calibration begins anew, with an archive of its
        own.

        Raises InputError where the archive cannot be read.
        """
        waiting: queue.Queue[_Came | None] = queue.Queue(MOST_WAITING)
        self._heard = time.perf_counter()
        if self.may_leave_out:
            self.coach.leaves_out = self._leaves_out
        self._publish(self.coach.state())
        works = (lambda: self._read(waiting), self._listen)
        threads = [
            threading.Thread(target=copy_context().run, args=(self._work, own), daemon=True) for own in works
        ]
        for thread in threads:
            thread.start()
        try:
            while not (self._finish or stopped() or self._is_over):
                try:
                    came = waiting.get(timeout=READ_S)
                except queue.Empty:
                    self._watch()
                    continue
                if came is None:
                    break
                self._take(came)
            self._take_the_rest(waiting)
        finally:
            self._stop.set()
        for thread in threads:
            thread.join(2.0)
        if self._failed is not None:
            raise self._failed
        self._publish(self.coach.state() | {"phase": ENDED}, self.ending())

    def end(self, summary: str) -> None:
        """Show what the calibration came to."""
        self._publish(self.coach.state() | {"phase": ENDED, "summary": summary, "request": None})

    @property
    def _is_over(self) -> bool:
        return self.coach.phase == ENDED or self.begins_anew

    def _take(self, came: _Came) -> None:
        for state in self.coach.take(*came):
            self._keep(state)
            self._publish(state)

    def _take_the_rest(self, waiting: queue.Queue[_Came | None]) -> None:
        """Take what was entered last: it comes back with frames, up to the mark that ends it."""
        if self.send is None or self._is_over:
            return
        with suppress(InputError):  # the recorder is gone, and nothing more comes
            if not self._finish:
                self.send({"kind": "finish"})
            until = time.perf_counter() + REST_S
            while not self._is_over and time.perf_counter() < until:
                with suppress(queue.Empty):
                    came = waiting.get(timeout=READ_S)
                    if came is None:
                        return
                    self._take(came)

    @property
    def begins_anew(self) -> bool:
        """Say whether receivers were put right in a recording of this program's own."""
        return self.send is not None and self.coach.restarts > 0

    def _work(self, work: Callable[[], None]) -> None:
        """Do a thread's work; what fails, whatever it is, is raised again by the thread that waits for it."""
        try:
            work()
        except Exception as error:
            self._failed = error

    def _read(self, waiting: queue.Queue[Any]) -> None:
        poses = LivePoses(self.coach.layout, Path(str(self.title["file"])))
        try:
            while not self._stop.is_set():
                ended, pieces = self.source.ended, self.source.read()
                for piece in pieces:
                    arrived = poses.add(piece)
                    if arrived is not None:
                        self._live(arrived)
                    self._put(waiting, (arrived, poses.marks()))
                if ended and not pieces:
                    break
                time.sleep(0 if pieces else READ_S)
        finally:
            self._put(waiting, None)

    def _put(self, waiting: queue.Queue[Any], what: Any) -> None:
        while not self._stop.is_set():
            try:
                waiting.put(what, timeout=0.2)
                return
            except queue.Full:
                continue

    def _live(self, arrived: Arrived) -> None:
        """Show poses, some of them, on the board at once."""
        self._heard = time.perf_counter()
        poses = arrived.poses
        self._newest_s = float(poses.time_s[-1])
        self.frames += len(poses.frame)
        known = self.coach.known
        if known is not None and not self.coach.findings:
            self.oldest_s = max(self.oldest_s, float(poses.time_s[-1]) - known.time_s)
        rows = np.flatnonzero(np.diff(np.floor(poses.time_s * SHOWN_HZ), prepend=-1.0) > 0)
        numbers = np.concatenate([poses.position_mm[rows], poses.quaternion[rows]], -1)
        numbers[~poses.valid[rows]] = np.nan
        self.board.show_poses(poses.time_s[rows].tolist(), numbers)

    def _listen(self) -> None:
        """Hand over what is entered at once: a touch is marked while it lasts, and an estimate takes a
        second.
        """
        try:
            while not self._stop.wait(LISTEN_S):
                for entry in [*self.board.entered(), *self.face.entered()]:
                    try:
                        self._hand_over(entry)
                    except InputError as error:
                        self._publish(self._state, str(error))
                    self._finish |= entry["kind"] == "finish"
        finally:
            self._finish = True  # who cannot be heard any more must not go on

    def _hand_over(self, entry: Mapping[str, Any]) -> None:
        if self.send is not None:
            check_names(checked_entry(entry), self.coach.layout, self.coach.setup)
            self.send(entry)
        elif entry["kind"] != "finish":
            raise InputError(tr("This recording is only watched: nothing is entered."))

    def _leaves_out(self, tick: int, time_s: float) -> bool:
        """Say whether a tick has no estimate for frames that wait; the archive keeps that, for a replay."""
        if self._newest_s - time_s <= BEHIND_S:
            return False
        if self.send is not None:
            with suppress(InputError):
                self.send({"kind": LEFT_OUT, "tick": tick})
        return True

    def _keep(self, state: Mapping[str, Any]) -> None:
        if self.log is not None:
            self.log.write(json.dumps(state, ensure_ascii=False, sort_keys=True) + "\n")

    def _watch(self) -> None:
        """Say, every LOST_S, that nothing comes."""
        times = int((time.perf_counter() - self._heard) / LOST_S)
        if times > self._lost and (self.frames or times * LOST_S >= FIRST_S):
            said = tr(
                "Nothing has come for {seconds:.0f} s: look at the cable and the recorder.",
                seconds=times * LOST_S,
            )
            self._publish(self.coach.state() | {"phase": "lost"}, said)
        self._lost = times

    def _publish(self, state: Mapping[str, Any], message: str = "") -> None:
        self._state = state
        whole = {**state, "title": self.title, "message": message}
        whole["hands"] = list(self.hands)
        whole["marks"] = names_of(self.coach.layout, self.coach.setup.points)
        with self._showing:
            self.board.publish(whole)
            self.face.show(whole)
