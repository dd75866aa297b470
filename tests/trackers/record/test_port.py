"""The port: real pseudo-terminals and sockets, what they give and how they end."""

import os
import socket
import time
import tty
from collections.abc import Iterator

import pytest
from tracker_processes import PATIENCE_S

from schemas.errors import InputError
from trackers.record.conversation import Conversation
from trackers.record.port import Port, PortGoneError, open_port


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


def test_chunks_have_the_time_of_their_arrival(pty_pair: tuple[int, str]) -> None:
    """Not that of the look at them: each between its sending and the sending of the next."""
    master, name = pty_pair
    port = open_port(name, 115200)
    reader = Conversation(port)
    sent_ns, chunks = [], []
    for _ in range(5):
        sent_ns.append(time.monotonic_ns())
        os.write(master, b"x")
        chunks += reader.keep(PATIENCE_S)
    sent_ns.append(time.monotonic_ns())
    reader.close()
    port.close()
    assert [chunk.data for chunk in chunks] == [b"x"] * 5
    for chunk, before_ns, after_ns in zip(chunks, sent_ns, sent_ns[1:], strict=False):
        assert before_ns <= chunk.host_ns <= after_ns


def test_two_programs_cannot_share_a_port(pty_pair: tuple[int, str]) -> None:
    first = open_port(pty_pair[1], 115200)
    with pytest.raises(InputError, match="another program has it open, and two cannot share a tracker"):
        open_port(pty_pair[1], 115200)
    first.close()
    open_port(pty_pair[1], 115200).close()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("/dev/no-such-port", "/dev/no-such-port: no such port; `shukotsu devices` lists"),
        ("socket://127.0.0.1:1", "socket://127.0.0.1:1: cannot be reached"),
        ("127.0.0.1:4001", "127.0.0.1:4001: no such port; for one on the network give --port socket://127."),
        ("nonsense://x", "nonsense://x: cannot be reached"),
        ("/dev/null", "/dev/null: is no port that can be opened"),
    ],
)
def test_ports_that_cannot_be_opened(name: str, sentence: str) -> None:
    with pytest.raises(InputError) as told:
        open_port(name, 115200)
    assert str(told.value).startswith(sentence)
    assert "\n" not in str(told.value)


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


def test_a_socket_that_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = open_port(f"socket://127.0.0.1:{server.getsockname()[1]}", 115200)
        other, _ = server.accept()
        other.sendall(b"abc")
        received = b""
        while len(received) < 3:
            received += port.read()
        assert received == b"abc"
        other.close()
    assert gone(port) == "it was closed at the other end"
    port.close()


def test_a_line_has_a_rate_only_where_one_is_known(pty_pair: tuple[int, str]) -> None:
    port = open_port(pty_pair[1], 115200)
    assert port.line_baud is None
    assert not port.tries_other_bauds
    port.close()
    port = open_port(pty_pair[1], 57600, line_rate=57600)
    assert (port.line_baud, port.tries_other_bauds) == (57600, True)
    port.set_baud(38400)
    assert (port.line_baud, port.baud) == (38400, 38400)
    port.close()
