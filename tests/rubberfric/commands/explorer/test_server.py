"""The server of the page: accepted and refused requests, and headers."""

import contextlib
import http.client
import json
import re
import socket
import threading
import time

import pytest

from rubberfric.commands.explorer import server as server_module
from rubberfric.commands.explorer.server import LARGEST_REQUEST, Answer, Server

PAGE = "<script nonce={}></script>"
LEAST = {"Content-Type": "application/json"}


def doubled(content):
    if not isinstance(content, dict):
        raise ValueError("content: must be an object\nin one line")
    return Answer("application/json", json.dumps({"twice": 2 * content["x"]}).encode())


def broken(content):
    raise RuntimeError(f"RESOURCE_EXHAUSTED {content}")


@pytest.fixture(scope="module")
def server():
    with Server(0, PAGE.format, {"double": doubled, "broken": broken}) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture
def ask(server):
    """Status, headers and text of an answer."""

    def call(method, path, body=None, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=20)
        try:
            connection.putrequest(method, path, skip_host=True)
            given = {"Host": server.hosts[0]}
            if body is not None:
                given |= LEAST | {"Origin": f"http://{server.hosts[0]}", "Content-Length": str(len(body))}
            given |= {name.replace("_", "-"): value for name, value in headers.items()}
            for name, value in given.items():
                for one in value if isinstance(value, list) else [value] if value is not None else []:
                    connection.putheader(name, one)
            connection.endheaders()
            if body is not None:
                connection.send(body)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read().decode()
        finally:
            connection.close()

    return call


def test_the_page_and_its_routes(server, ask):
    assert server.server_address[0] == "127.0.0.1"
    assert server.url == f"http://127.0.0.1:{server.server_port}/{server.token}/"
    assert len(server.token) >= 43  # 256 bits
    status, headers, text = ask("GET", f"/{server.token}/")
    nonce = re.fullmatch(r"<script nonce=(\S+)></script>", text)[1]
    assert status == 200 and f"script-src 'nonce-{nonce}';" in headers["Content-Security-Policy"]
    assert headers["Content-Security-Policy"].startswith("default-src 'none';")
    assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cache-Control"] == "no-store"
    assert "Access-Control-Allow-Origin" not in headers
    assert nonce not in ask("GET", f"/{server.token}/")[2]
    for name in server.hosts:
        status, headers, text = ask(
            "POST", f"/{server.token}/double", b'{"x": 21}', Host=name, Origin=f"http://{name}"
        )
        assert (status, json.loads(text)) == (200, {"twice": 42})
        assert re.fullmatch(r"total;dur=[\d.]+", headers["Server-Timing"])


def test_a_browser_is_let_in_once(server, ask):
    """By a URL that other users may have seen meanwhile."""
    path = server.entrance.removeprefix(f"http://{server.hosts[0]}")
    assert server.token not in path
    assert ask("GET", path, Host="evil.example")[0] == ask("POST", path, b"{}")[0] == 403
    status, headers, _ = ask("GET", path)
    assert (status, headers["Location"]) == (303, f"/{server.token}/")
    assert ask("GET", path)[0] == 403
    assert ask("GET", headers["Location"])[0] == 200


@pytest.mark.parametrize(
    "host",
    [
        *("evil.example", "evil.example:PORT", "127.0.0.1", "127.0.0.1:1", "localhost.evil:PORT"),
        *("[::1]:PORT", None, ["127.0.0.1:PORT", "127.0.0.1:PORT"]),
    ],
)
def test_a_foreign_host_gets_nothing(server, ask, host):
    """A domain name that resolves to this machine."""
    port = str(server.server_port)
    host = (
        [x.replace("PORT", port) for x in host]
        if isinstance(host, list)
        else host and host.replace("PORT", port)
    )
    for method, path, body in (("GET", "", None), ("POST", "double", b'{"x": 1}')):
        status, _, text = ask(method, f"/{server.token}/{path}", body, Host=host)
        assert (status, text) == (403, "the header Host must name this server")


@pytest.mark.parametrize(
    "path",
    [
        *("", "/", "/double", "//double", "/wrong/", "/TOKE/", "/TOKENx/", "/token", "x", "/../TOKEN/"),
        *("/%2e/TOKEN/", "/wrong/double", "http://127.0.0.1/TOKEN/", "/T%4FKEN/"),
    ],
)
def test_without_the_token_there_is_nothing(server, ask, path):
    path = path.replace("TOKEN", server.token).replace("TOKE", server.token[:-1]) or "/"
    for method, body in (("GET", None), ("POST", b'{"x": 1}')):
        status, headers, text = ask(method, path, body)
        assert (status, text) == (403, "the URL must be complete, as the command printed it")
        assert "'nonce" not in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    "path",
    [
        *("../../etc/passwd", "..%2f..%2fetc/passwd", "/etc/passwd", "page.html", "double/"),
        *("double/../double", ".", "?x=1", "double?x=1", "#", "%2e%2e/", "..\\..\\x", "double%00", "curves"),
    ],
)
def test_routes_are_exact(server, ask, path):
    """There are no files that a path could lead to."""
    assert ask("GET", f"/{server.token}/{path}")[0] == 404
    assert ask("POST", f"/{server.token}/{path}", b'{"x": 1}')[0] == 404


def test_methods(server, ask):
    assert ask("GET", f"/{server.token}/double")[0] == 404
    assert ask("POST", f"/{server.token}/", b"{}")[0] == 404
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "X<script>"):
        status, headers, text = ask(method, f"/{server.token}/double", b'{"x": 1}')
        assert (status, text) == (501, "Not Implemented"), method
        assert headers["Content-Type"].startswith("text/plain")
        assert "Access-Control-Allow-Methods" not in headers


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": None}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "https://127.0.0.1:PORT"}, 403),
        ({"Origin": "http://localhost:PORT"}, 403),  # the Host says 127.0.0.1
        ({"Content_Type": "text/plain"}, 415),  # which another page's form could send
        ({"Content_Type": None}, 415),
        ({"Content_Length": None}, 411),
        ({"Content_Length": "-1"}, 411),
        ({"Content_Length": "1e1"}, 411),
        ({"Content_Length": ["9", "9"]}, 411),
        ({"Content_Length": "²"}, 411),
        ({"Transfer_Encoding": "chunked"}, 411),
        ({"Content_Length": str(LARGEST_REQUEST + 1)}, 413),
        ({"Content_Length": "9" * 5000}, 413),
    ],
)
def test_what_another_page_could_post_is_refused(server, ask, headers, status):
    port = str(server.server_port)
    headers = {
        name: value.replace("PORT", port) if isinstance(value, str) else value
        for name, value in headers.items()
    }
    assert ask("POST", f"/{server.token}/double", b'{"x": 1}', **headers)[0] == status


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"{", b"[1]", b'"x"', b'{"x": NaN}', b'{"x": Infinity}', b'{"x": -Infinity}', b"\xff"),
        *(b"[" * 9000, b'{"x": ' + b"9" * 6000 + b"}"),
    ],
)
def test_what_is_no_json_of_numbers(server, ask, body):
    status, headers, text = ask("POST", f"/{server.token}/double", body)
    assert status == 400 and "\n" not in text and headers["Content-Type"].startswith("text/plain")


def test_a_failure_is_said_and_the_next_is_answered(server, ask):
    assert ask("POST", f"/{server.token}/broken", b"1")[::2] == (500, "RESOURCE_EXHAUSTED 1")
    assert ask("POST", f"/{server.token}/double", b'{"x": 1}')[0] == 200


@pytest.mark.parametrize(
    "said", [b"", b"GET / HT", b"POST /", b"\x16\x03\x01\x02\x00\x01", b"G" * 70000 + b"\r\n"]
)
def test_a_connection_that_says_nothing_holds_nobody_up(server, ask, said):
    """Browsers open some beforehand."""
    with socket.create_connection(("127.0.0.1", server.server_port)) as one:
        one.sendall(said)
        assert ask("POST", f"/{server.token}/double", b'{"x": 1}')[0] == 200


def test_more_connections_than_there_is_room_for(server, ask):
    idle = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(40)]
    for one in idle:
        one.close()
    for _ in range(100):  # until their threads have seen it
        try:
            assert ask("POST", f"/{server.token}/double", b'{"x": 1}')[0] == 200
            break
        except (ConnectionError, http.client.HTTPException):
            continue
    else:
        pytest.fail("is refused")


@pytest.mark.parametrize("said", [b"", b"POST /x HTTP/1.1\r\nHost: a\r\n", b"G"])
def test_slow_connections_do_not_lock_others_out(server, ask, said):
    """They hold all threads; the oldest one is closed for each new connection."""
    slow = [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(40)]
    try:
        for one in slow:
            with contextlib.suppress(ConnectionError, BrokenPipeError):  # the oldest are closed already
                one.sendall(said)
        for _ in range(3):
            begin = time.monotonic()
            assert ask("POST", f"/{server.token}/double", b'{"x": 1}')[0] == 200
            assert time.monotonic() - begin < 5
    finally:
        for one in slow:
            one.close()


def test_a_byte_now_and_then_does_not_hold_a_connection_open(server, monkeypatch):
    monkeypatch.setattr(server_module, "REQUEST_TIMEOUT", 0.5)
    with socket.create_connection(("127.0.0.1", server.server_port)) as one:
        for _ in range(180):  # 9 s
            try:
                one.sendall(b"G")
            except ConnectionError:
                break
            time.sleep(0.05)
        else:
            pytest.fail("is still open")


def test_a_request_that_has_arrived_is_answered_however_many_others_come(server, ask):
    """A computation may take longer than a request may take to arrive."""
    entered, go_on = threading.Event(), threading.Event()

    def wait(_):
        entered.set()
        assert go_on.wait(20)
        return Answer("application/json", b"1")

    server.routes["wait"] = wait
    found = []
    asking = threading.Thread(target=lambda: found.append(ask("POST", f"/{server.token}/wait", b"1")[0]))
    asking.start()
    slow = []
    try:
        assert entered.wait(20)
        slow += [socket.create_connection(("127.0.0.1", server.server_port)) for _ in range(40)]
    finally:
        go_on.set()
        asking.join(20)
        for one in slow:
            one.close()
    assert found == [200]


def test_a_port_that_is_taken(server):
    with pytest.raises(OSError, match="in use"):
        Server(server.server_port, PAGE.format, {})
