"""Command line: coach a hand's calibration, that it records, or another process, or that was recorded."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import ExitStack
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from shukotsu.commands.study_file import USUAL
from shukotsu.errors import InputError
from shukotsu.sentences.translation import N_
from shukotsu.stages import command_line
from shukotsu.stages.capture import tracker_options

if TYPE_CHECKING:
    from shukotsu.coach.board import Board
    from shukotsu.coach.session import Session
    from shukotsu.coach.setup import CoachSetup
    from shukotsu.coach.study_sheets import HandDone
    from shukotsu.coach.terminal_face import TerminalFace
    from shukotsu.trackers.record.recording_terminal import StopRequest, Terminal

SOLVING = N_("Ended. The hand is now solved as the study will.")
PUT_RIGHT = "receivers were put right in it"
SOURCES = ("port", "follow", "replay")


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu coach",
        "Record a hand's calibration and say, while the receivers are on it, what is worn wrongly, which\n"
        "movement or measurement helps most next, how sure each joint is, and when it is enough. A page on\n"
        "this computer shows the same; its address is printed.",
        "shukotsu coach --port /dev/ttyUSB0 --study study.yaml --subject 03 --hand right\n"
        "  shukotsu coach --follow captures/03.arrows --study study.yaml --subject 03 --hand right\n"
        "  shukotsu coach --replay captures/03.arrows --speed 4",
        records_failure=False,
    )
    tracker_options.add_tracker(parser)
    add = parser.add_argument
    add("--follow", type=Path, metavar="FILE", help="coach an archive that another process writes")
    add("--replay", type=Path, metavar="FILE", help="coach an archive that was recorded, as it was then")
    add("--speed", type=float, default=1.0, help="of --replay; 0: as fast as it goes (default: 1)")
    add("--study", type=Path, help=f"the study file (default: {USUAL} of this folder)")
    add("--subject", help="whose hand (default: the study's next one without a calibration)")
    add("--hand", choices=("right", "left"), help="which hand")
    add("--session", default="", help="which session, where receivers are put on anew")
    add("--task", default="rom", help="what the study calls the recording (default: rom)")
    add("--calliper", action="store_true", help="a calliper is at hand: lengths are asked for too")
    add(
        "--point", action="append", default=[], metavar="NAME=X,Y,Z",
        help="a point in the transmitter's frame, mm, that fingertips may be laid on",
    )  # fmt: skip
    add("--language", choices=("en", "ja"), default="en", help="of what is shown (default: en)")
    add("--no-page", action="store_true", help="the terminal alone")
    add(
        "--listen",
        metavar="ADDRESS:PORT",
        help="let other computers see the page, by a password that is asked for",
    )
    add("--log", type=Path, metavar="FILE", help="write every state as a line of JSON")
    return parser


def main(argv: list[str]) -> int:
    """Coach; give the exit code."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # the other processors are the recorder's
    return command_line.run(build_parser, argv, coach)


def coach(arguments: argparse.Namespace) -> None:
    """Coach one hand after the other. Raises InputError where there is nothing to coach."""
    given = [name for name in SOURCES if getattr(arguments, name) is not None]
    if len(given) != 1:
        raise InputError("expected one of --port (to record), --follow and --replay")
    if not arguments.speed >= 0:
        raise InputError(f"--speed: is {arguments.speed:g}; expected 0 or more")
    from shukotsu.coach.board import Board
    from shukotsu.coach.terminal_face import TerminalFace
    from shukotsu.stages.report.wording import speaking
    from shukotsu.trackers.record.recording_terminal import StopRequest, Terminal, stop_on_signals

    password = _password(arguments.listen)
    stop = StopRequest()
    arguments.side = arguments.hand  # of every next hand too
    with stop_on_signals(stop), speaking(arguments.language), ExitStack() as stack:
        if arguments.log is not None:
            arguments.log = stack.enter_context(_opened(arguments.log))
        board = Board()
        if not arguments.no_page:
            _open_page(arguments, board, password, stack)
        terminal = stack.enter_context(Terminal(sys.stderr, sys.stdin))
        face = TerminalFace(terminal)
        if arguments.port is not None:
            while _record(arguments, board, face, stop) or _goes_on(arguments, board, terminal, stop):
                pass
            return
        _coach_archive(arguments, board, face, stop)


def _opened(log: Path) -> TextIO:
    """Open a log, a new one or over an older one. Raises InputError where the file is none."""
    from shukotsu.files.text_files import reading

    with reading(log, "a log to write"):
        if log.exists():
            with log.open("rb") as before:
                if before.read(1) not in (b"", b"{"):
                    raise InputError(f"--log: {log}: is there and no log; give another name")
        return log.open("w", encoding="utf-8")


def _password(listen: str | None) -> str | None:
    """Ask for the page's password, before signals are taken: Ctrl-C ends the asking too."""
    if listen is None:
        return None
    from getpass import getpass

    try:
        return getpass("password for other computers: ")
    except EOFError:
        raise InputError("--listen: no password was given; start it where one can be typed") from None


def _open_page(arguments: argparse.Namespace, board: Board, password: str | None, stack: ExitStack) -> None:
    from shukotsu.coach.page_server import serve

    server = serve(board, listen=arguments.listen, password=password, language=arguments.language)
    stack.callback(server.close)
    if server.notice:
        print(server.notice, file=sys.stderr)
    print(f"page: {server.url}", file=sys.stderr)


def _study(arguments: argparse.Namespace) -> Path:
    study: Path = arguments.study or USUAL
    if not study.is_file():
        raise InputError(
            f"{study}: no such file; name the study with --study, or make one: `shukotsu new FOLDER`"
        )
    return study


def _setup(arguments: argparse.Namespace) -> CoachSetup:
    """Give the setup by the study and the options; the study's next hand where none is named."""
    from shukotsu.coach.study_setup import setup_of

    study = _study(arguments)
    subject, hand = arguments.subject, arguments.hand
    for name in ("subject", "session", "task"):
        text = getattr(arguments, name)
        if text is not None and (
            text != text.strip() or not (text.isprintable() and (text or name == "session"))
        ):
            raise InputError(f"--{name}: is {text!r}; expected a name on one line, without blanks around it")
    if subject is None:
        following = next((own for own in _hands(arguments) if not own.done), None)
        if following is None:
            raise InputError(
                f"{study}: names no hand without a calibration; fill in its sheet of participants, or give "
                "--subject and --hand"
            )
        subject, hand = following.subject, following.hand
    if hand is None:
        raise InputError("--hand: is missing; expected right or left")
    setup = setup_of(study, subject, hand, arguments.session, arguments.task)
    return replace(setup, calliper=arguments.calliper, points=dict(map(_point, arguments.point)))


def _point(text: str) -> tuple[str, tuple[float, float, float, float]]:
    from shukotsu.stages.fit_hand.touches import TOUCH_SD_MM

    name, _, numbers = text.partition("=")
    try:
        x, y, z = (float(number) for number in numbers.split(","))
        if not (name.strip() and isfinite(x) and isfinite(y) and isfinite(z)):
            raise ValueError
    except ValueError:
        raise InputError(
            f"--point: is {text!r}; expected NAME=X,Y,Z in mm, such as post=120,-40,15"
        ) from None
    return name, (x, y, z, TOUCH_SD_MM)


def _title(setup: CoachSetup, archive: Path) -> dict[str, Any]:
    from time import strftime

    named = {"study": setup.study, "subject": setup.subject, "hand": setup.hand, "file": archive.name}
    return {**named, "since": strftime("%H:%M")}


def _record(arguments: argparse.Namespace, board: Board, face: TerminalFace, stop: StopRequest) -> bool:
    """Record and coach one hand; tell whether the same one is to be recorded anew."""
    from shukotsu.coach.coach import Coach
    from shukotsu.coach.final import sheet_rows_of
    from shukotsu.coach.recorder import Recorder
    from shukotsu.coach.session import Session
    from shukotsu.coach.setup import KIND
    from shukotsu.coach.study_setup import archive_of, enter_recording
    from shukotsu.sentences.translation import tr
    from shukotsu.stages.capture.record_tracker import EXIT_CUT_SHORT
    from shukotsu.stages.fit_hand.compile_kernel import compile_all

    study, setup = _study(arguments), _setup(arguments)
    hands = [own._asdict() for own in _hands(arguments)]  # as long as none of them is entered yet
    compile_all()  # and all is imported, before anything comes
    coach, archive = Coach(setup), archive_of(study, setup)
    recorder = Recorder(archive, _tracker_options(arguments))
    try:
        recorder.send({"kind": KIND, "setup": setup.to_json()})
        title = _title(setup, archive)
        session = Session(coach, recorder, board, face, title, recorder.send, hands, arguments.log)
        session.ending = lambda: recorder.last_note if recorder.exit_code is not None else tr(SOLVING)
        session.run(lambda: bool(stop))
    finally:
        code = recorder.stop()
        print("\n".join(recorder.notes), file=sys.stderr)
    if not archive.exists() or (code == command_line.EXIT_BAD_INPUT and not session.frames):
        raise InputError(f"{arguments.port}: nothing was recorded ({recorder.last_note})")
    if session.begins_anew and not stop:
        rows = sheet_rows_of(coach)
        enter_recording(study, setup, archive, PUT_RIGHT, rows)
        return True
    _finish(study, setup, session, archive)
    if code:
        sys.exit(EXIT_CUT_SHORT)
    return False


def _hands(arguments: argparse.Namespace) -> list[HandDone]:
    """Give the hands that are calibrated in this session, done or not."""
    from shukotsu.coach.study_sheets import hands_of

    return hands_of(_study(arguments), arguments.side, arguments.session)


def _goes_on(arguments: argparse.Namespace, board: Board, terminal: Terminal, stop: StopRequest) -> bool:
    """Say who is done, and ask on a terminal whether the next hand follows; set the options to that."""
    from time import sleep

    hands = _hands(arguments)
    done = [f"{own.subject} {own.hand}" for own in hands if own.done]
    following = next((own for own in hands if not own.done), None)
    print(f"done: {', '.join(done) or 'none'}", file=sys.stderr)
    if following is None or not terminal.has_keys or stop:
        return False
    print(f"next: {following.subject} {following.hand}; Return begins, q ends", file=sys.stderr)
    arguments.subject, arguments.hand = following.subject, following.hand
    while not stop:
        pressed = terminal.pressed().lower()
        if "q" in pressed or "\r" in pressed or "\n" in pressed:
            board.entered()  # of the hand before
            return "q" not in pressed
        sleep(0.1)
    return False


def _tracker_options(arguments: argparse.Namespace) -> list[str]:
    """Return the tracker's options as the recorder takes them."""
    argv = [f"--port={arguments.port}", f"--baud={arguments.baud}", f"--items={arguments.items}"]
    argv += [f"--hemisphere={arguments.hemisphere}"]
    for name in ("tracker", "rate", "stations"):
        value = getattr(arguments, name)
        argv += [] if value is None else [f"--{name}={value}"]
    return argv + ["--no-filters"] * arguments.no_filters


def _finish(study: Path, setup: CoachSetup, session: Session, archive: Path) -> None:
    """Solve the hand as the study will; enter the summary into the archive and all else into the sheets."""
    import time

    from shukotsu.coach.final import final_summary, sheet_rows_of
    from shukotsu.coach.study_setup import enter_recording
    from shukotsu.coach.wording import summary_sentence
    from shukotsu.stages.capture.formats.raw_capture import COACH_SUMMARY
    from shukotsu.trackers.archive import append_events

    if session.coach.known is None:
        rows = sheet_rows_of(session.coach)
        sheets = enter_recording(study, setup, archive, "ended before the hand was known", rows)
        print(f"note: {archive}: ended before the hand was known; entered in {sheets[0]} as excluded")
        return
    print(f"{archive}: solving the hand as the study will ...", file=sys.stderr)
    try:
        summary, rows = final_summary(archive, session.coach)
    except InputError as error:
        rows = sheet_rows_of(session.coach)
        sheets = enter_recording(study, setup, archive, f"the coach made no hand of it: {error}", rows)
        print(f"note: {archive}: {error}; entered in {sheets[0]} as excluded", file=sys.stderr)
        return
    try:
        append_events(archive, [(COACH_SUMMARY, time.perf_counter_ns(), summary)])
    except (InputError, OSError) as error:
        print(f"note: the summary is not in the archive: {error}", file=sys.stderr)
    print(summary_sentence(summary))
    session.end(summary_sentence(summary))
    exclude = PUT_RIGHT if session.coach.restarts else ""
    sheets = enter_recording(study, setup, archive, exclude, rows)
    for finding in summary["findings"]:
        print(f"note: {finding}", file=sys.stderr)
    entered = ", ".join(map(str, sheets))
    age = f"advice at most {session.oldest_s:.1f} s old"
    print(f"{archive}: {session.frames} frames; {age}; entered in {entered}")


def _coach_archive(
    arguments: argparse.Namespace, board: Board, face: TerminalFace, stop: StopRequest
) -> None:
    from shukotsu.coach.coach import ENDED, Coach
    from shukotsu.coach.final import final_summary, read_setup
    from shukotsu.coach.replayed import Replayed
    from shukotsu.coach.session import Session
    from shukotsu.coach.wording import summary_sentence
    from shukotsu.trackers.archive import FollowedArchive

    archive: Path = arguments.replay or arguments.follow
    setup, skipped = None, set[int]()
    try:
        setup, skipped = read_setup(archive)
    except InputError:
        if arguments.replay is not None and arguments.study is None:
            raise  # what has no setup that can be read needs a study; what does not grow must be whole
    setup = setup or _setup(arguments)
    source = FollowedArchive(archive) if arguments.replay is None else Replayed(archive, arguments.speed)
    title = _title(setup, archive)
    session = Session(Coach(setup, skipped), source, board, face, title, log=arguments.log)
    session.may_leave_out = arguments.replay is None
    session.run(lambda: bool(stop))
    if not session.frames and source.ended:
        raise InputError(f"{archive}: has no frame of a tracker; expected a recording of a hand that moves")
    if session.coach.known is None:
        print(f"note: {archive}: {session.frames} frames show no hand yet", file=sys.stderr)
    elif source.ended or session.coach.phase == ENDED:
        print(summary_sentence(final_summary(archive, session.coach)[0]))
