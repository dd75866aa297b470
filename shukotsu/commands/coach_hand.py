"""Command line: coach a hand's calibration while it is recorded, followed or replayed."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from shukotsu import command_line
from shukotsu.commands import USUAL
from shukotsu.errors import InputError, count_of

if TYPE_CHECKING:
    from shukotsu.coach.coach import Coach, CoachedHand
    from shukotsu.coach.live_poses import Source
    from shukotsu.tracker.archive import Piece
    from shukotsu.tracker.conversation import StopRequest

READ_S, LOST_S, FIRST_S = 0.1, 5.0, 20.0
"""Interval between readings; time without data after which a warning is printed; and the longer such time at
the start, while the tracker is being set up."""


def build_parser() -> argparse.ArgumentParser:
    """Return the command's argument parser."""
    parser = command_line.parser(
        "shukotsu coach",
        "While the receivers are on a hand, report what is worn wrongly, which movement helps most next,\n"
        "how certain each joint is, and when it is enough. Ctrl-C ends it. A page, one HTML file that\n"
        "reloads itself, shows the same and the hand.",
        "shukotsu coach --replay FILE --speed 4\n"
        "  shukotsu coach --follow FILE --hand left\n"
        "  shukotsu coach --port /dev/ttyUSB0 --study study.yaml --subject 03 -- --hemisphere 0,0,1",
    )
    add = parser.add_argument
    add("--port", help="record from this port, such as /dev/ttyUSB0, and coach what is recorded")
    add("--follow", type=Path, metavar="FILE", help="coach an archive that `shukotsu record` is writing")
    add("--replay", type=Path, metavar="FILE", help="coach a finished archive as if it were being recorded")
    add("--speed", type=float, default=1.0, help="of --replay; 0: as fast as possible (default: 1)")
    add("--page", type=Path, metavar="FILE", help="the page (default: beside the recording; --replay: none)")
    add("--study", type=Path, help=f"the study (default: none; with --port {USUAL} in this folder, if any)")
    add("--subject", help="whose hand it is in the study")
    add("--hand", choices=("right", "left"), default="right", help="which hand (default: right)")
    add("--layout", help="which receiver sits where (default: the study's, or liberty16)")
    add("recorder", nargs="*", metavar="-- OPTIONS", help="of `shukotsu record`, with --port")
    return parser


def coach(arguments: argparse.Namespace) -> None:
    """Coach one hand. Raises InputError if options contradict each other or there is nothing to coach."""
    if [arguments.port, arguments.follow, arguments.replay].count(None) != 2:
        raise InputError("expected one of --port (to record), --follow and --replay")
    if not arguments.speed >= 0:
        raise InputError(f"--speed: is {arguments.speed:g}; expected 0 or more")
    if arguments.page is not None and arguments.page.suffix != ".html":
        raise InputError(f"--page: is {arguments.page}; expected a name that ends with .html")
    if arguments.recorder and arguments.port is None:
        raise InputError(f"{arguments.recorder[0]}: is an option of the recorder, which needs --port")
    if arguments.follow is not None and not arguments.follow.is_file():
        raise InputError(f"{arguments.follow}: no such file; start `shukotsu record --out` first")
    from shukotsu.coach.study import hand_alone, hand_of
    from shukotsu.tracker.conversation import StopRequest, stop_on_signals

    if arguments.port is not None and arguments.study is None and USUAL.is_file():
        arguments.study = USUAL
    if arguments.study is None:
        hand = hand_alone(arguments.layout, arguments.hand)
    elif arguments.subject is None:
        raise InputError(f"--subject: is missing; expected whose hand it is in {arguments.study}")
    else:
        hand = hand_of(arguments.study, arguments.subject, arguments.hand, arguments.layout)
    stop = StopRequest()
    with stop_on_signals(stop):
        if arguments.port is None:
            _coach_archive(arguments, hand, stop)
        while arguments.port is not None and _record(arguments, hand, stop):
            print("receivers were corrected: a new recording begins", file=sys.stderr)


def _coach_archive(arguments: argparse.Namespace, hand: CoachedHand, stop: StopRequest) -> None:
    from shukotsu.coach.coach import Coach
    from shukotsu.coach.live_poses import Replayed
    from shukotsu.tracker.archive import FollowedArchive

    coached, path, page = Coach(hand), arguments.replay or arguments.follow, arguments.page
    if arguments.replay is not None:
        _run(coached, Replayed(path, arguments.speed), path, page, stop, live=False)
    else:
        _run(coached, FollowedArchive(path), path, page or path.with_suffix(".html"), stop)
    if not coached.frames:
        raise InputError(f"{path}: has no frame of a tracker; expected a recording of a hand that moves")


def _record(arguments: argparse.Namespace, hand: CoachedHand, stop: StopRequest) -> bool:
    """Record and coach one hand; return whether receivers were corrected, so that it is recorded again."""
    from shukotsu.coach.coach import Coach
    from shukotsu.coach.live_poses import Recorder
    from shukotsu.coach.study import enter_recording, new_archive
    from shukotsu.commands.record_tracker import EXIT_CUT_SHORT
    from shukotsu.fit.compile_kernel import compile_all

    folder = Path() if arguments.study is None else arguments.study.parent
    compile_all()  # before data arrive
    coached, archive = Coach(hand), new_archive(folder, hand.whose, hand.hand)
    archive.parent.mkdir(parents=True, exist_ok=True)
    recorder = Recorder(archive, [f"--port={arguments.port}", *arguments.recorder])
    arguments.page = arguments.page or archive.with_suffix(".html")  # also of the recordings that follow
    try:
        _run(coached, recorder, archive, arguments.page, stop)
    finally:
        code = recorder.stop()
    if not coached.frames:
        last_note = "".join(recorder.notes[-1:]).removeprefix("error: ")
        raise InputError(f"{arguments.port}: nothing was recorded ({last_note})")
    print("\n".join(recorder.notes), file=sys.stderr)
    exclude = "" if coached.calibration.estimate else "it shows no hand"
    exclude = "receivers were corrected during it" if coached.restarts else exclude
    if arguments.study is not None:
        try:
            sheet = enter_recording(arguments.study, hand.whose, archive, exclude)
        except InputError as error:
            raise InputError(f"{archive} is recorded, but is not in the study's sheet: {error}") from error
        how = f" as excluded: {exclude}" if exclude else ""
        print(f"{archive}: entered in {sheet}{how}")
    else:
        print(f"{archive}: {count_of(coached.frames, 'frame')}")
    if code:
        sys.exit(EXIT_CUT_SHORT)
    return bool(coached.restarts) and not stop


def _run(
    coached: Coach, source: Source, archive: Path, page: Path | None, stop: StopRequest, *, live: bool = True
) -> None:
    """Coach until the source ends, a stop is requested or, while recording, receivers were corrected."""
    from shukotsu.coach.live_poses import LivePoses, Recorder
    from shukotsu.coach.page import EVERY_S, write_page
    from shukotsu.tables.poses import joined_poses

    title, poses = f"{archive.name}, {coached.hand.hand} hand", LivePoses(coached.hand.layout, archive)
    written_s, heard_s, lost = -EVERY_S, time.monotonic(), ""

    def advise(pieces: list[Piece]) -> bool:
        """Print the coach's advice on the frames in these pieces; return whether there were any frames."""
        arrived = [whole for piece in pieces if (whole := poses.add(piece)) is not None]
        for line in coached.take(joined_poses(arrived), may_leave_out=live) if arrived else ():
            print(line, flush=True)
        return bool(arrived)

    def show(page: Path) -> Path | None:
        """Write the page and return its path, or None if a live recording has to go on without it."""
        try:
            write_page(page, coached, title, lost)
        except InputError as error:
            if not live:
                raise
            print(f"note: the page is no longer updated: {error}", file=sys.stderr)
            return None
        return page

    def is_over() -> bool:
        return isinstance(source, Recorder) and coached.restarts > 0

    while not stop and not is_over():
        ended, pieces = source.ended, source.read()
        if advise(pieces):
            heard_s, lost = time.monotonic(), ""
        elif live and time.monotonic() - heard_s > (LOST_S if coached.frames else FIRST_S) and not lost:
            lost = "No data arrive: check the cable and the recorder."
            print(lost, file=sys.stderr, flush=True)
        if page is not None and coached.frames and time.monotonic() - written_s >= EVERY_S:
            page = show(page)
            if written_s < 0 and page is not None:
                print(f"page: {page.resolve()}", file=sys.stderr)
            written_s = time.monotonic()
        if ended and not pieces:
            break
        time.sleep(0 if pieces else READ_S)
    if is_over():
        return
    if isinstance(source, Recorder):
        source.stop()
        while pieces := source.read():
            advise(pieces)
    if coached.frames:
        print("\n".join(coached.end()), flush=True)
        if page is not None:
            show(page)


main = command_line.script(build_parser, coach)
