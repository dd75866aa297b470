"""The page's server against those who are not the operator, and those who do not behave."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import closing, suppress
from http.client import HTTPConnection, HTTPResponse
from typing import Any

import pytest

from shukotsu.coach import page_server
from shukotsu.coach.board import Board
from shukotsu.coach.page_server import (
    FILES,
    MOST_CONNECTIONS,
    MOST_OF_ONE,
    MOST_VIEWERS,
    TOKEN,
    PageServer,
    serve,
)
from shukotsu.errors import InputError

DONE = b'{"kind": "done"}'
PASSWORD = "生徒の合言葉 42"


@pytest.fixture
def server() -> Iterator[PageServer]:
    board = Board()
    board.publish({"time_s": 1, "secret": "subject 03"})
    with closing(serve(board)) as served:
        yield served


def ask(server: PageServer, path: str, body: bytes | None = None, **headers: str) -> HTTPResponse:
    """Ask as the page does, but for the headers given; an empty one is left out. A body is POSTed."""
    at = f"127.0.0.1:{server.port}"
    given = {"Host": at, TOKEN: server.token}
    if body is not None:
        own = {"Content-Type": "application/json", "Content-Length": str(len(body))}
        given |= {"Origin": f"http://{at}", **own}
    given |= {name.replace("_", "-"): value for name, value in headers.items()}
    link = HTTPConnection("127.0.0.1", server.port, timeout=60)
    link.putrequest("GET" if body is None else "POST", path, skip_host=True, skip_accept_encoding=True)
    for name, value in given.items():
        if value:
            link.putheader(name, value)
    link.endheaders(body)
    return link.getresponse()


def newest(answer: HTTPResponse) -> dict[str, object]:
    """Read events up to a state."""
    for line in answer:
        if line == b"event: state\n":
            found: dict[str, object] = json.loads(answer.readline().removeprefix(b"data: "))
            return found
    raise AssertionError("no state came")


def test_the_token_opens_the_page_and_its_frame_holds_nothing(server: PageServer) -> None:
    assert server.url == f"http://127.0.0.1:{server.port}/#{server.token}"
    assert not server.notice
    assert server.server_address[0] == "127.0.0.1"
    for path, (_, kind) in FILES.items():
        answer = ask(server, path, Host=f"LOCALHOST:{server.port}")
        content = answer.read().decode()
        assert (answer.status, answer.getheader("Content-Type")) == (200, f"{kind}; charset=utf-8")
        assert server.token not in content
        assert "subject 03" not in content
        assert "default-src 'self'" in answer.getheader("Content-Security-Policy", "")
        assert answer.getheader("Cache-Control") == "no-store"
        assert answer.getheader("Access-Control-Allow-Origin") is answer.getheader("Set-Cookie") is None
    assert newest(ask(server, "/events"))["time_s"] == 1
    assert ask(server, "/enter", DONE).status == 204
    assert server.board.entered() == [{"kind": "done"}]


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.com"},
        {"Host": "evil.com:{port}", "Origin": "http://evil.com:{port}"},
        {"Host": "127.0.0.1"},
        {"Host": "127.0.0.1:1"},
        {"Host": "192.168.0.2:{port}"},
        {"Host": "localhost.evil.com:{port}"},
        {"Host": ""},
        {"Origin": "http://evil.com"},
        {"Origin": "null"},
        {"Origin": "http://localhost:{port}"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "same-site"},
        {TOKEN: ""},
        {TOKEN: "guess"},
        {TOKEN: "", "Cookie": f"{TOKEN}={{token}}"},
    ],
)
def test_only_our_page_reads_and_enters(server: PageServer, headers: dict[str, str]) -> None:
    given = {name: text.format(port=server.port, token=server.token) for name, text in headers.items()}
    for body in (None, DONE):
        answer = ask(server, "/events" if body is None else "/enter", body, **given)
        assert answer.status == 403
        assert b"subject 03" not in answer.read()
    assert server.board.entered() == []


@pytest.mark.parametrize(
    ("status", "body", "headers"),
    [
        (415, DONE, {"Content_Type": "text/plain"}),
        (403, DONE, {"Origin": ""}),
        (411, DONE, {"Content_Length": ""}),
        (411, DONE, {"Content_Length": "-1"}),
        (411, DONE, {"Transfer_Encoding": "chunked"}),
        (413, DONE, {"Content_Length": "9" * 5000}),
        (413, b" " * 3000, {}),
        (400, b"{", {}),
        (400, b"[" * 2000, {}),
        (400, b"\xff", {}),
        (400, b'{"kind": "done", "event": "stop"}', {}),
    ],
)
def test_only_short_json_of_the_contract_is_entered(
    server: PageServer, status: int, body: bytes, headers: dict[str, str]
) -> None:
    assert ask(server, "/enter", body, **headers).status == status
    assert server.board.entered() == []


def test_there_are_six_paths_and_reading_changes_nothing(server: PageServer) -> None:
    for path in ("/x", "/../board.py", "/page/page.js", f"/events?token={server.token}", "*"):
        assert ask(server, path).status == 404
    assert ask(server, "/enter").status == ask(server, "/", DONE).status == 405
    assert ask(server, "/open", b'{"password": "None"}').status == 403
    assert server.board.entered() == []


@pytest.mark.parametrize(
    "sent",
    [
        b"\x16\x03\x01\x02\x00\x01\x00",
        b"GET /events\r\n\r\n",
        b"OPTIONS /events HTTP/1.1\r\nAccess-Control-Request-Headers: x-coach-token\r\n\r\n",
        b"\r\n" * 9,
        b"A" * 99999,
    ],
)
def test_bytes_that_are_no_request_get_no_data_and_end(server: PageServer, sent: bytes) -> None:
    found = b""
    link = socket.create_connection(("127.0.0.1", server.port), timeout=60)
    with link, suppress(ConnectionError):
        link.sendall(sent)
        with suppress(OSError):  # already reset by the server, which refused
            link.shutdown(socket.SHUT_WR)
        while part := link.recv(4096):
            found += part
    assert not any(text in found for text in (b"subject 03", b"Traceback", b"Access-Control"))
    assert ask(server, "/").status == 200


def test_a_request_that_comes_byte_by_byte_is_ended(
    server: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_server, "REQUEST_S", 0.5)
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as link:
        link.sendall(b"GET / HTTP/1.1\r\nX: ")
        link.settimeout(0.05)
        for _ in range(1000):
            with suppress(TimeoutError, ConnectionResetError, BrokenPipeError):
                link.sendall(b"x")
                assert link.recv(1) == b""
                return
    raise AssertionError("it was listened to for ever")


def test_viewers_are_capped_and_one_that_never_reads_holds_up_nobody(server: PageServer) -> None:
    views = [ask(server, "/events") for _ in range(MOST_VIEWERS + 4)]
    assert [view.status for view in views] == [200] * MOST_VIEWERS + [503] * 4
    reader = views[MOST_VIEWERS - 1]
    large = "x" * 500_000  # the systems' buffers of who does not read are soon full
    for time_s in range(2, 30):
        server.board.publish({"time_s": time_s, "large": large})
        server.board.show_poses([time_s], [[[0.0] * 7]])
        while time_s % 9 == 2 and newest(reader)["time_s"] != time_s:
            pass
    for view in views:
        view.close()
    for _ in range(1000):  # those that went away are noticed
        server.board.show_poses([0], [[[0.0] * 7]])
        if ask(server, "/events").status == 200:
            return
    raise AssertionError("no place became free")


def test_one_address_takes_neither_all_connections_nor_all_guesses(server: PageServer) -> None:
    asked = [server.verify_request(None, ("10.0.0.1", port)) for port in range(MOST_CONNECTIONS)]
    assert sum(asked) == MOST_OF_ONE
    assert server.verify_request(None, ("10.0.0.2", 1))
    assert not server.takes("guess", "10.0.0.1")
    with pytest.raises(TimeoutError):
        server.takes("guess", "10.0.0.1")
    assert not server.takes("guess", "10.0.0.2"), "it is looked at"


def test_other_computers_change_the_password_for_the_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: "Labor-3")
    given = json.dumps({"password": PASSWORD}).encode()
    with closing(serve(Board(), listen="0.0.0.0:0", password=PASSWORD)) as server:
        assert f"http://Labor-3:{server.port}/" in server.notice
        assert PASSWORD not in server.notice
        assert ask(server, "/events", **{TOKEN: ""}).status == 401
        for host, status in [("192.168.0.2", 200), ("labor-3.local", 200), ("evil.com", 403), ("1.2.3", 403)]:
            assert ask(server, "/", Host=f"{host}:{server.port}").status == status
        assert json.loads(ask(server, "/open", given).read()) == {"token": server.token}
        assert ask(server, "/open", given, Origin="http://evil.com").status == 403
        for wrong in (b'{"password": "guess"}', b'{"password": null}', b"[]"):
            assert ask(server, "/open", wrong).status == 403
            assert ask(server, "/open", given).status == 429  # for WRONG_S
            server._shut_until.clear()
        assert ask(server, "/open", given).status == 200


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"listen": "0.0.0.0:0"}, "only with a password of at least 8 letters"),
        ({"listen": "0.0.0.0:0", "password": "short"}, "only with a password"),
        ({"listen": "lab:80", "password": PASSWORD}, "no address to listen at"),
        ({"listen": "0.0.0.0:99999", "password": PASSWORD}, "no address to listen at"),
        ({"port": 99999}, "cannot be served at 127.0.0.1, port 99999"),
        ({}, "choose another port"),
    ],
)
def test_what_cannot_be_served_is_refused(server: PageServer, options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        serve(Board(), **{"port": server.port, **options})  # which is in use
