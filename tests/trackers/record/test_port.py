"""The port: real pseudo-terminals and sockets, what they give and how they end."""

import os
import time
import tty
from collections.abc import Iterator

import pytest
from tracker_processes import PATIENCE_S

from shukotsu.errors import InputError
from shukotsu.trackers.record.conversation import Conversation
from shukotsu.trackers.record.port import Port, PortGoneError, open_port


@pytest.fixture
def pty_pair() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    for descriptor in (master, slave):
        try:
            os.close(descriptor)
        except OSError:
            continue


def taken(reader: Conversation, size: int) -> bytes:
    """What the reader gives, until it is so much."""
    data, end = b"", time.monotonic() + PATIENCE_S
    while len(data) < size and time.monotonic() < end:
        data += b"".join(chunk.data for chunk in reader.keep(0.05))
    return data


def test_every_byte_passes_both_ways(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    reader = Conversation(port)
    everything = bytes(range(256))
    os.write(master, everything)
    assert taken(reader, 256) == everything
    port.write(everything)
    assert os.read(master, 1000) == everything
    reader.close()
    port.close()


def test_two_programs_cannot_share_a_port(pty_pair: tuple[int, str]) -> None:
    first = open_port(pty_pair[1], 115200)
    with pytest.raises(InputError, match="another program has it open, and two cannot share a tracker"):
        open_port(pty_pair[1], 115200)
    first.close()
    open_port(pty_pair[1], 115200).close()


@pytest.mark.parametrize("name", ["socket://", "socket://a:b", "rfc2217://host", "loop://", "tcp://host:1"])
def test_what_is_no_port_of_a_network_is_not_tried(name: str) -> None:
    with pytest.raises(InputError, match=f"{name}: is no port of a network; expected socket://HOST:PORT"):
        open_port(name, 115200)


@pytest.mark.parametrize("name", ["igtl://host:18944", "lsl:Hand"])
def test_a_port_that_left_says_what_to_take(name: str) -> None:
    with pytest.raises(InputError, match=r"^--port: (igtl|lsl) left in 0\.2: record with "):
        open_port(name, 115200)


def gone(port: Port) -> str:
    """How the port's end is told; read until then."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        try:
            port.read()
        except PortGoneError as error:
            return str(error)
    return "not at all"


def test_a_device_that_is_pulled_out(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    os.close(master)
    assert gone(port) != "not at all"
    port.close()
