"""An emulated tracker that runs for as long as a test; a stand-in for a tracker that is recorded."""

import io
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from tracker_processes import at_a_port, emulator

from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker.archive import open_archive
from shukotsu.tracker.port import open_port
from shukotsu.tracker.records import concatenated
from shukotsu.tracker.request import RecordingRequest, StopRequest
from shukotsu.tracker.session import RecordingPlan, record
from shukotsu.tracker.stream import Tally, blocks_of


@pytest.fixture
def emulated(tmp_path: Path) -> Iterator[Callable[..., str]]:
    """Start an emulated tracker with the emulator's own options; gives the port to open."""
    with ExitStack() as running:

        def start(*options: str, tcp: bool = False) -> str:
            link = tmp_path / f"tracker{len(list(tmp_path.glob('tracker*')))}"
            where = ("--tcp", "0") if tcp else ("--pty", str(link))
            return running.enter_context(emulator(*options, port=where)).name

        yield start


@pytest.fixture
def recorded(tmp_path: Path) -> Callable[..., object]:

    def run(device, request: RecordingRequest):
        plan = RecordingPlan(tmp_path / "rom.arrows", request, duration_s=0.5)
        with at_a_port(device) as name:
            port = open_port(name, 115200)
            try:
                record(plan, port, LinePrinter(io.StringIO()), StopRequest(), {})
            finally:
                port.close()
        tally = Tally()
        blocks = list(blocks_of(open_archive(plan.out), tally))
        return concatenated([block.records for block in blocks]), blocks[0].settings, tally

    return run
