"""The port: real pseudo-terminals and sockets, what they give and how they end."""

import os
import socket
import time
import tty
from collections.abc import Iterator

import pytest

from schemas.errors import InputError
from stages.capture.record.port import Port, PortGoneError, open_port, perhaps_taken
from stages.capture.record.reader import Reader


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


def taken(reader: Reader, size: int, patience_s: float = 5.0) -> bytes:
    """What the reader gives, until it is so much."""
    data, end = b"", time.monotonic() + patience_s
    while len(data) < size and time.monotonic() < end:
        data += b"".join(chunk.data for chunk in reader.take(0.05))
    return data


def test_every_byte_passes_both_ways(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    reader = Reader(port)
    everything = bytes(range(256))
    os.write(master, everything)
    assert taken(reader, 256) == everything
    port.write(everything)
    assert os.read(master, 1000) == everything
    reader.close()
    port.close()


def test_chunks_have_the_time_of_their_arrival(pty_pair: tuple[int, str]) -> None:
    master, name = pty_pair
    port = open_port(name, 115200)
    reader = Reader(port)
    sent_ns = []
    for _ in range(5):
        time.sleep(0.05)
        sent_ns.append(time.monotonic_ns())
        os.write(master, b"x")
    time.sleep(0.05)
    chunks = reader.take()
    reader.close()
    port.close()
    assert [chunk.data for chunk in chunks] == [b"x"] * 5
    assert all(0 <= chunk.host_ns - ns < 40_000_000 for chunk, ns in zip(chunks, sent_ns, strict=True))


def test_two_programs_cannot_share_a_port(pty_pair: tuple[int, str]) -> None:
    first = open_port(pty_pair[1], 115200)
    with pytest.raises(InputError, match="another program has it open, and two cannot share a tracker"):
        open_port(pty_pair[1], 115200)
    first.close()
    open_port(pty_pair[1], 115200).close()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("/dev/no-such-port", "/dev/no-such-port: no such port; `python -m stages.capture devices` lists"),
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


def test_a_network_port_that_refuses_is_perhaps_taken() -> None:
    with pytest.raises(InputError, match=r"refused.*; perhaps another program has it$"):
        open_port("socket://127.0.0.1:1", 115200)
    assert perhaps_taken("/dev/ttyUSB0") == ""


def gone(port: Port) -> str:
    """How the port's end is told; read until then."""
    end = time.monotonic() + 5
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
        time.sleep(0.05)
        assert port.read() == b"abc"
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
