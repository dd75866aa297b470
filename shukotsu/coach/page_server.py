"""The coach's page: served to browsers of this computer, or with a password to others.

State and poses go out as Server-Sent Events, entries come in by POST; one request a connection, with bounds
on its bytes and its time, and on the threads of all.

Listening at 127.0.0.1 is no boundary: pages of other sites, open in the same browser, reach it too, and by a
name that they point there (DNS rebinding) as if it were their own. So the Host must be ours, the Origin the
same, and all but the page's empty frame needs a token that the terminal alone shows. It comes as a header of
our own, which no other site may send, and is no cookie, which would go to every port of the host.
"""

from __future__ import annotations

import hmac
import io
import ipaddress
import json
import os
import secrets
import socket
import sys
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import closing
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from socketserver import ThreadingTCPServer
from threading import BoundedSemaphore, Event, Lock, Thread
from typing import Any

from shukotsu.coach.board import Board
from shukotsu.errors import InputError

MOST_VIEWERS = 16
MOST_CONNECTIONS, MOST_OF_ONE = 64, 48
"""Of all, and of one address: nobody takes all of them."""
MOST_BYTES = 16_384
"""Of a request, its headers among them; MOST_BODY_BYTES of what is entered."""
MOST_BODY_BYTES = 2048
REQUEST_S = 10.0
"""In which a whole request must have come, and in which a viewer must take what it is sent."""
HEARTBEAT_S = 2.0
SENT_BYTES = 65_536
"""That wait in the system for a viewer: what is older than a second or two helps nobody."""
SHORTEST_PASSWORD = 8
WRONG_S = 2.0
"""After a wrong password, in which no other is looked at."""

TOKEN = "X-Coach-Token"
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Connection": "close",
}
PAGE = Path(__file__).with_name("page")
FILES = {
    "/": ("page.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/page.css": ("page.css", "text/css"),
}
METHODS = {**dict.fromkeys((*FILES, "/events"), "GET"), "/enter": "POST", "/open": "POST"}
"""By path; there is no other."""


def serve(
    board: Board,
    *,
    port: int = 0,
    listen: str | None = None,
    password: str | None = None,
    language: str = "en",
) -> PageServer:
    """Serve the page of a board until it is closed.

    port : at 127.0.0.1, 0 for any that is free. listen : "0.0.0.0:8765" instead, for other computers, which
    need the password. language : en or ja, of the page's labels; sentences come with the state. Raises
    InputError if it cannot be.
    """
    host = "127.0.0.1"
    if listen is not None:
        host, port = _address(listen)
        if password is None or len(password) < SHORTEST_PASSWORD:
            raise InputError(
                f"other computers may open the page at {listen} only with a password of at least"
                f" {SHORTEST_PASSWORD} letters; give one, or leave the address out"
            )
    try:
        return PageServer(board, (host, port), password if listen else None, language)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or "no such port"
        raise InputError(
            f"the page cannot be served at {host}, port {port}: {reason}; choose another port"
        ) from error


class PageServer(ThreadingTCPServer):
    """A page that is being served.

    port : where it listens. url : for the operator's terminal alone: it holds the token. notice : a sentence
    to print that says what it opens to other computers; empty where it opens nothing.
    """

    daemon_threads = True
    request_queue_size = MOST_CONNECTIONS
    allow_reuse_address = os.name == "posix"  # elsewhere it would let two programs have one port

    def __init__(self, board: Board, at: tuple[str, int], password: str | None, language: str) -> None:
        self.board = board
        self.token = secrets.token_urlsafe(32)
        self.asks_password = password is not None
        self.closed = Event()
        self.viewers = BoundedSemaphore(MOST_VIEWERS)
        self.files = _files(language)
        self._password = password
        self._counting = Lock()
        self._shut_until: dict[str, float] = {}
        self._connections: Counter[str] = Counter()
        super().__init__(at, _Handler)
        self.port = int(self.server_address[1])
        host, own = at[0], socket.gethostname()
        self._names = {"localhost", "127.0.0.1", *self.asks_password * (own.lower(), f"{own.lower()}.local")}
        self.url = f"http://{'127.0.0.1' if host == '0.0.0.0' else host}:{self.port}/#{self.token}"
        self.notice = self.asks_password * (
            f"Other computers can open http://{own if host == '0.0.0.0' else host}:{self.port}/ with the"
            " password: they see the hand and what is said of it, and can enter touches, lengths and the end."
            " Nothing is encrypted, the password neither: use a network that you trust."
        )
        Thread(target=self.serve_forever, args=(0.1,), daemon=True).start()

    def close(self) -> None:
        """End the page: no connection is taken any more, and those that are open end within HEARTBEAT_S."""
        self.closed.set()
        self.shutdown()
        self.server_close()

    def knows_host(self, host: str) -> bool:
        """Say whether a Host header is one that the page is reached by: no site can point these elsewhere."""
        name, _, port = host.lower().rpartition(":")
        return port == str(self.port) and (name in self._names or (self.asks_password and _is_address(name)))

    def takes(self, password: object, address: str) -> bool:
        """Say whether it is the page's password. Raises TimeoutError where a wrong one came just now from
        there.
        """
        with self._counting:
            now = time.monotonic()
            self._shut_until = {own: until for own, until in self._shut_until.items() if now < until}
            if address in self._shut_until:
                raise TimeoutError
            right = None not in (password, self._password) and same(str(password), str(self._password))
            if not right:
                self._shut_until[address] = now + WRONG_S
        return right

    def verify_request(self, request: Any, client_address: Any) -> bool:  # noqa: ARG002
        """Say whether a thread may be had for one more request."""
        with self._counting:
            own = self._connections[client_address[0]]
            if own >= MOST_OF_ONE or self._connections.total() >= MOST_CONNECTIONS:
                return False
            self._connections[client_address[0]] += 1
        return True

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer one request."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._counting:
                self._connections[client_address[0]] -= 1
                self._connections += Counter()  # keeps those that have any

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a reader that went away."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Bounded(io.RawIOBase):
    """What comes in by a connection: so many bytes within so long, however slowly each of them comes."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._left = MOST_BYTES
        self._end = time.monotonic() + REQUEST_S

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left_s = self._end - time.monotonic()
        if left_s <= 0 or self._left <= 0:
            raise TimeoutError
        self._connection.settimeout(left_s)
        found = self._connection.recv_into(buffer, min(len(buffer), self._left))
        self._left -= found
        return found


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: PageServer
    server_version, sys_version = "shukotsu", ""
    timeout = REQUEST_S

    def setup(self) -> None:
        super().setup()
        self.rfile = io.BufferedReader(_Bounded(self.connection))

    def do_GET(self) -> None:
        refusal = self._refusal("GET")
        if refusal is not None:
            self._reply(*refusal)
        elif self.path in FILES:
            self._reply(200, self.server.files[self.path], f"{FILES[self.path][1]}; charset=utf-8")
        elif self.server.viewers.acquire(blocking=False):
            try:
                self._show_events()
            finally:
                self.server.viewers.release()
        else:
            self._reply(503, f"{MOST_VIEWERS} pages are open already; close one.")

    def do_POST(self) -> None:
        self._reply(*(self._refusal("POST") or self._taken()))

    def _refusal(self, method: str) -> tuple[int, str] | None:
        """Give status and sentence for what no page of ours asks for."""
        headers, page = self.headers, self.server
        hosts, origin = headers.get_all("Host", []), headers.get("Origin")
        if len(hosts) != 1 or not page.knows_host(hosts[0]):
            return 403, "This page is not reached by that name."
        if self.path not in METHODS:
            return 404, "There is nothing here."
        if METHODS[self.path] != method:
            return 405, f"Only {METHODS[self.path]} is answered here."
        foreign = headers.get("Sec-Fetch-Site", "same-origin") != "same-origin" and self.path not in FILES
        if foreign or (origin != f"http://{hosts[0]}" and (origin is not None or method == "POST")):
            return 403, "Another page asked."
        if self.path in ("/events", "/enter") and not same(headers.get(TOKEN, ""), page.token):
            if page.asks_password:
                return 401, "The password is needed."
            return 403, "Open the address that the terminal shows."
        if method == "GET":
            return None
        length = headers.get("Content-Length", "")
        if headers.get("Content-Type") != "application/json":
            return 415, "Only JSON is taken."
        if not (length.isascii() and length.isdigit()) or "Transfer-Encoding" in headers:
            return 411, "The length of the body must be said."
        return (413, "The body is too long.") if len(length) > 6 or int(length) > MOST_BODY_BYTES else None

    def _taken(self) -> tuple[int, str, str] | tuple[int, str]:
        """Take what was posted; give the answer: status, body and its type."""
        try:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        except (ValueError, RecursionError):
            return 400, "The body is not JSON."
        try:
            if self.path == "/enter":
                self.server.board.enter(body)
                return 204, ""
            password = body.get("password") if isinstance(body, dict) else None
            if self.server.takes(password, self.client_address[0]):
                return 200, json.dumps({"token": self.server.token}), "application/json"
            return 403, "That is not the password."
        except TimeoutError:
            return 429, f"A wrong password came just now: wait {WRONG_S:.0f} s."
        except InputError as error:
            return 400, str(error)

    def _show_events(self) -> None:
        """Send state and poses until the viewer goes away or the page is closed."""
        self.connection.settimeout(REQUEST_S)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
        self._head(200, {"Content-Type": "text/event-stream"})
        with closing(self.server.board.subscribe()) as viewer:
            while not self.server.closed.is_set():
                found = viewer.take(HEARTBEAT_S) or [("beat", "0")]
                text = "".join(f"event: {kind}\ndata: {data}\n\n" for kind, data in found)
                self.wfile.write(text.encode())

    def _reply(self, status: int, body: str | bytes, kind: str = "text/plain; charset=utf-8") -> None:
        content = body.encode() if isinstance(body, str) else body
        self._head(status, {"Content-Type": kind, "Content-Length": str(len(content))} if content else {})
        self.wfile.write(content)

    def _head(self, status: int, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, **headers}.items():
            self.send_header(name, value)
        self.end_headers()

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request, with the headers that every answer has."""
        del message, explain
        self._reply(code, "That request is not understood.")

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Keep quiet: the terminal is the operator's."""


def same(one: str, other: str) -> bool:
    """Say whether two texts are the same, in a time that does not tell where they differ."""
    return hmac.compare_digest(one.encode("utf-8", "replace"), other.encode())


def _files(language: str) -> dict[str, bytes]:
    """Read the page's files by path; the colours are the report's."""
    from shukotsu.stages.report.palette import css

    files = {path: (PAGE / name).read_bytes() for path, (name, _) in FILES.items()}
    files["/"] = files["/"].replace(b'lang="en"', f'lang="{language}"'.encode(), 1)
    files["/page.css"] = css().encode() + files["/page.css"]
    return files


def _address(listen: str) -> tuple[str, int]:
    """Give host and port of an address to listen at; raises InputError."""
    host, _, port = listen.rpartition(":")
    if _is_address(host) and port.isascii() and port.isdigit() and len(port) < 6 and int(port) < 65536:
        return host, int(port)
    raise InputError(f"{listen!r} is no address to listen at; expected one such as 0.0.0.0:8765")


def _is_address(name: str) -> bool:
    try:
        return bool(ipaddress.IPv4Address(name))
    except ValueError:
        return False
