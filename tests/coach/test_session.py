"""A session by itself: what is entered reaches the recorder at once, and the right one."""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest
from coached_hands import setup

from shukotsu.coach import session
from shukotsu.coach.board import Board
from shukotsu.coach.coach import Coach
from shukotsu.coach.live_poses import Arrived
from shukotsu.coach.session import Session
from shukotsu.coach.terminal_face import TerminalFace
from shukotsu.trackers.archive import Piece
from shukotsu.trackers.record.recording_terminal import Terminal

TOUCH = {"kind": "touch", "digit": "index", "meets": "thumb"}


@dataclass
class Waiting:
    """An archive in which nothing comes but these pieces, over and over."""

    pieces: list[Piece]
    ended = False

    def read(self) -> list[Piece]:
        """Give them."""
        return self.pieces


@dataclass
class Busy(Coach):
    """A coach that thinks until somebody stops it."""

    until: threading.Event = field(default_factory=threading.Event)

    def take(self, arrived: Arrived | None, marks: Sequence[Mapping[str, Any]] = ()) -> list[dict[str, Any]]:
        """Think."""
        del arrived, marks
        assert self.until.wait(60), "what was entered waited for the coach"
        return []


def of(
    coach: Coach, board: Board, *pieces: Piece, send: Callable[[Mapping[str, Any]], None] | None = None
) -> Session:
    title = {"study": "piano", "subject": "03", "hand": "left", "file": "03.arrows"}
    face = TerminalFace(Terminal(io.StringIO(), None))
    return Session(coach, Waiting([*pieces]), board, face, title, send)


def test_what_is_entered_reaches_the_recorder_while_the_coach_thinks() -> None:
    board, coach, sent = Board(), Busy(setup()), list[Mapping[str, Any]]()
    viewer = board.subscribe()

    def send(entry: Mapping[str, Any]) -> None:
        sent.append(entry)
        coach.until.set()

    def enter() -> None:
        assert viewer.take(60)  # the session's first state
        board.enter(TOUCH)

    thread = threading.Thread(target=enter)
    thread.start()
    of(coach, board, Piece.nothing(), send=send).run(coach.until.is_set)
    thread.join()
    assert sent[0] == TOUCH


def test_where_nothing_can_be_entered_any_more_the_session_ends_with_the_error() -> None:
    class Broken(TerminalFace):
        def entered(self) -> list[dict[str, Any]]:
            raise OSError("the keyboard is gone")

    broken = of(Coach(setup()), Board())
    broken.face = Broken(Terminal(io.StringIO(), None))
    with pytest.raises(OSError, match="keyboard is gone"):
        broken.run(lambda: False)


@pytest.mark.parametrize("entry", [TOUCH, {"kind": "finish"}])
def test_who_only_watches_a_recording_enters_nothing(entry: dict[str, Any]) -> None:
    board = Board()
    viewer, said = board.subscribe(), list[str]()

    def stopped() -> bool:
        board.enter(entry)
        states = [json.loads(text) for kind, text in viewer.take(0.5) if kind == "state"]
        said.extend(state["message"] for state in states if state["message"])
        return bool(said)

    of(Coach(setup()), board).run(stopped)  # ends by the message, or by the finish
    assert [text.split(":")[0] for text in said] == ["This recording is only watched"] * (entry is TOUCH)


def test_where_nothing_ever_comes_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "LOST_S", 0.2)
    monkeypatch.setattr(session, "FIRST_S", 0.4)
    board = Board()
    viewer, states = board.subscribe(), list[dict[str, Any]]()

    def stopped() -> bool:
        states.extend(json.loads(text) for kind, text in viewer.take(0.1) if kind == "state")
        return any(state["phase"] == "lost" for state in states)

    of(Coach(setup()), board).run(stopped)
    assert "Nothing has come" in states[-1]["message"]
