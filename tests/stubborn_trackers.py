"""An emulated tracker that hears something else, or nothing, for one of its commands; and setting it up."""

from tracker_processes import at_a_port

from shukotsu.tracker.emulate.device import EmulatedLiberty
from shukotsu.tracker.families import StreamSettings
from shukotsu.tracker.record.conversation import Conversation
from shukotsu.tracker.record.port import open_port
from shukotsu.tracker.record.request import RecordingRequest
from shukotsu.tracker.record.session import DRIVERS

EVERYTHING_HEARD = b"not a command"


class StubbornTracker:
    """A stand-in for a tracker: the bytes `unheard` come to the device as `heard`."""

    streaming = True

    def __init__(self, device: EmulatedLiberty, unheard: bytes, heard: bytes = b"") -> None:
        self.device = device
        self.period_s = float(1 / device.rate)
        self.unheard, self.heard = unheard, heard

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        return self.device.receive(data.replace(self.unheard, self.heard))

    def cycle(self) -> bytes:
        """Return what it sends in one cycle."""
        return self.device.next_cycle()


def set_up(tracker: StubbornTracker, request: RecordingRequest) -> tuple[StreamSettings, list[str]]:
    """Set it up at a pseudo-terminal; gives the settings and the warnings."""
    with at_a_port(tracker) as name:
        port = open_port(name, 115200)
        conversation = Conversation(port)
        driver = DRIVERS[request.family](conversation, request)
        try:
            return driver.set_up(), driver.warnings
        finally:
            conversation.close()
            port.close()
