"""Server of the page, which answers only this machine and only requests with the token of the URL.

Another page in the same browser can send requests to this server, even by a domain name that resolves to
127.0.0.1. The header Host must therefore name this server, and the header Origin of a POST request must name
the page of this server. Every request needs the token, which other users of the machine do not know. The
server compares the path of a request with a few fixed routes and opens no files.
"""

import contextlib
import hmac
import json
import secrets
import socket
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, NamedTuple

from rubberfric.base.checks import shown

ADDRESS = "127.0.0.1"
# Most bytes of a request. The values of some hundred sliders take fewer.
LARGEST_REQUEST = 2**14
# Seconds until a request must have arrived. A slower one would keep a thread.
REQUEST_TIMEOUT = 10.0
# Most simultaneous requests, because each has a thread. Further ones displace the slowest.
MOST_REQUESTS = 32
# Seconds in which the thread of a closed connection must end.
_HANDOVER = 1.0

_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
_POLICY = (
    "default-src 'none'; script-src {0}; style-src {0}; connect-src 'self'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)


class Answer(NamedTuple):
    """Content of a response."""

    kind: str  # media type of the content
    content: bytes
    headers: dict[str, str] = {}  # noqa: RUF012 (never changed)
    status: HTTPStatus = HTTPStatus.OK


class Refused(Exception):
    """Error with which the server refuses a request."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


class Server(ThreadingHTTPServer):
    """Server of a page and of its POST routes.

    Parameters
    ----------
    port : number of the port, or 0 for any free port
    page : function of a nonce that returns the page, whose scripts and style have the nonce
    routes : dict from name to a function of the posted JSON value, which raises ValueError for invalid values
    """

    daemon_threads = True
    request_queue_size = MOST_REQUESTS

    def __init__(
        self, port: int, page: Callable[[str], str], routes: dict[str, Callable[[Any], Answer]]
    ) -> None:
        super().__init__((ADDRESS, port), Handler)
        self.page, self.routes = page, routes
        self.token = secrets.token_urlsafe(32)
        self._entrance = [secrets.token_urlsafe(32)]
        self.turn = threading.Lock()
        self._room = threading.BoundedSemaphore(MOST_REQUESTS)
        # Time at which each connection was accepted whose request has not arrived, the oldest first.
        self._arriving: dict[Any, float] = {}
        self._lock = threading.Lock()

    @property
    def hosts(self) -> tuple[str, str]:
        """Return the allowed values of the Host header."""
        return f"{ADDRESS}:{self.server_port}", f"localhost:{self.server_port}"

    @property
    def url(self) -> str:
        """Return the URL of the page, with the token."""
        return f"http://{self.hosts[0]}/{self.token}/"

    @property
    def entrance(self) -> str:
        """Return a one-time URL for the browser, whose arguments other users of the machine may see."""
        return f"http://{self.hosts[0]}/{self._entrance[0]}/"

    def enters(self, path: str) -> bool:
        """Return True if a path is the path of the one-time URL, and invalidate this URL."""
        there = any(hmac.compare_digest(path.encode(), f"/{key}/".encode()) for key in self._entrance)
        try:
            return there and bool(self._entrance.pop())
        except IndexError:  # another thread was faster
            return False

    def process_request(self, request: Any, client_address: Any) -> None:
        """Process a request in a new thread.

        If all threads are in use, close the oldest connection whose request has not arrived. If there is
        none, close the new connection.
        """
        if not self._room.acquire(blocking=False):
            self._close_slow(1)
            if not self._room.acquire(timeout=_HANDOVER):
                self.shutdown_request(request)
                return
        with self._lock:
            self._arriving[request] = time.monotonic()
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer one request."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self.has_arrived(request)
            self._room.release()

    def has_arrived(self, request: Any) -> None:
        """Note that a request is complete, so that its connection is not closed before the answer."""
        with self._lock:
            self._arriving.pop(request, None)

    def service_actions(self) -> None:
        """Close connections whose request has not arrived in time, which a byte now and then would delay."""
        late = time.monotonic() - REQUEST_TIMEOUT
        with self._lock:
            count = sum(begin < late for begin in self._arriving.values())
        self._close_slow(count)

    def _close_slow(self, count: int) -> None:
        with self._lock:
            for request in list(self._arriving)[:count]:
                del self._arriving[request]
                with contextlib.suppress(OSError):  # the other end was faster
                    request.shutdown(socket.SHUT_RDWR)  # its thread reads the end and closes it

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore broken connections."""


class Handler(BaseHTTPRequestHandler):
    """Handler of one request."""

    server: Server  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = REQUEST_TIMEOUT
    server_version, sys_version = "rubberfric", ""

    def do_GET(self) -> None:
        """Send the page."""
        self.server.has_arrived(self.connection)
        self._answer(self._page)

    def do_POST(self) -> None:
        """Answer a POST request of the page."""
        self._answer(self._posted)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send an error as plain text without repeating the request."""
        del message, explain
        self._refuse(code, HTTPStatus(code).phrase)

    def log_message(self, format: str, *arguments: Any) -> None:
        """Log nothing, because a log would contain the token."""

    def _answer(self, work: Callable[[], Answer]) -> None:
        try:
            if self._only("Host") not in self.server.hosts:
                raise Refused(HTTPStatus.FORBIDDEN, "the header Host must name this server")
            answer = work()
        except Refused as error:
            self._refuse(error.status, str(error))
        except ValueError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, " ".join(str(error).split()))
        except (FloatingPointError, MemoryError, RuntimeError) as error:  # JAX's are the last
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, " ".join(str(error).split()))
        else:
            self._send(answer.status, answer)

    def _refuse(self, code: int, why: str) -> None:
        self._send(code, Answer("text/plain; charset=utf-8", why.encode()))

    def _send(self, code: int, answer: Answer) -> None:
        self.send_response(code)
        headers = {"Content-Type": answer.kind, "Content-Length": str(len(answer.content))}
        headers |= {"Content-Security-Policy": _POLICY.format("'none'")} | _HEADERS | answer.headers
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(answer.content)

    def _page(self) -> Answer:
        if self.server.enters(self.path):
            return Answer("text/plain", b"", {"Location": f"/{self.server.token}/"}, HTTPStatus.SEE_OTHER)
        if self._route() != "":
            raise Refused(HTTPStatus.NOT_FOUND, "page not found")
        nonce = secrets.token_urlsafe(16)
        policy = {"Content-Security-Policy": _POLICY.format(f"'nonce-{nonce}'")}
        return Answer("text/html; charset=utf-8", self.server.page(nonce).encode(), policy)

    def _posted(self) -> Answer:
        work = self.server.routes.get(self._route())
        if work is None:
            raise Refused(HTTPStatus.NOT_FOUND, "page not found")
        host = self._only("Host")
        if self._only("Origin") != f"http://{host}":
            raise Refused(HTTPStatus.FORBIDDEN, "the header Origin must name this server")
        if self._only("Content-Type") != "application/json":
            raise Refused(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "Content-Type: must be application/json")
        content = _read_json(self._body())
        with self.server.turn:
            begin = time.perf_counter()
            answer = work(content)
            spent = 1e3 * (time.perf_counter() - begin)
        return answer._replace(headers=answer.headers | {"Server-Timing": f"total;dur={spent:.1f}"})

    def _route(self) -> str:
        """Return the part of the path after the token ("" for the page), or refuse a wrong token."""
        begin, token, *route = (*self.path.split("/", 2), "", "")[:3]
        known = hmac.compare_digest(token.encode(errors="replace"), self.server.token.encode())
        if begin != "" or not known:
            raise Refused(HTTPStatus.FORBIDDEN, "the URL must be complete, as the command printed it")
        return route[0]

    def _only(self, name: str) -> str | None:
        """Return the value of a header, or None if the header is missing or repeated."""
        values = self.headers.get_all(name) or []
        return values[0] if len(values) == 1 else None

    def _body(self) -> bytes:
        text = self._only("Content-Length") or ""
        if self.headers.get("Transfer-Encoding") is not None or not (text.isascii() and text.isdigit()):
            raise Refused(HTTPStatus.LENGTH_REQUIRED, "Content-Length: must be given")
        if len(text) > len(str(LARGEST_REQUEST)) or int(text) > LARGEST_REQUEST:
            raise Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"must have at most {LARGEST_REQUEST} bytes")
        content = self.rfile.read(int(text))
        self.server.has_arrived(self.connection)
        return content


def _read_json(content: bytes) -> Any:
    """Parse JSON, and raise ValueError for invalid JSON, NaN and infinities."""

    def refuse(name):
        raise ValueError(f"{name}: must be a finite number")

    try:
        return json.loads(content.decode("utf-8"), parse_constant=refuse)
    except RecursionError:
        raise ValueError(f"{shown(content)}: is nested too deeply") from None
