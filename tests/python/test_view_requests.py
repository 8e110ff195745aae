"""Who may ask the server of `o80 view`, over real sockets."""

import json
import socket
from collections.abc import Iterator
from http.client import HTTPConnection
from typing import Any

import pytest

import o80
from o80.view.serve import page_server
from o80.view.server import LARGEST_REQUEST, PageServer

TIMEOUT = 60.0


@pytest.fixture
def server(segment: str) -> Iterator[PageServer]:
    with (
        o80.robots.load("two_joints").inline(segment) as frontend,
        page_server([segment]) as server,
    ):
        frontend.burst(5)
        yield server


def ask(
    server: PageServer, method: str, target: str, headers: dict[str, str], body: str = ""
) -> tuple[int, str]:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=TIMEOUT)
    try:
        connection.request(method, target, body, headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def bearer(server: PageServer, **more: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {server.token}", **more}


def post(server: PageServer, path: str, body: Any) -> tuple[int, dict[str, Any]]:
    code, text = ask(server, "POST", path, bearer(server), json.dumps(body))
    return code, json.loads(text)


def raw(server: PageServer, *lines: str) -> str:
    """The first line of the answer to what no HTTP library would send."""
    with socket.create_connection(("127.0.0.1", server.port), TIMEOUT) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        return connection.makefile().readline().strip()


def test_the_page_comes_with_the_token_alone(server: PageServer) -> None:
    code, page = ask(server, "GET", f"/?token={server.token}", {})
    assert code == 200
    assert "<!doctype html>" in page
    assert "new Page()" in page
    assert server.token not in page


@pytest.mark.parametrize(
    "target", ["/", "/?token=", "/?token=wrong", "/?token=%ff%00", "/page/main.js"]
)
def test_nothing_comes_without_the_token(server: PageServer, target: str) -> None:
    code, text = ask(server, "GET", target, {})
    assert code == 403
    assert "the token is missing or wrong" in text
    assert server.token not in text


@pytest.mark.parametrize("path", ["/look", "/halt", "/resume"])
@pytest.mark.parametrize("given", ["", "Bearer ", "Bearer wrong", "Basic dXNlcg=="])
def test_no_request_is_obeyed_without_the_token(server: PageServer, path: str, given: str) -> None:
    [segment] = [entry.name for entry in o80.segments()]
    body = json.dumps({"segment": segment})
    code, _ = ask(server, "POST", path, {"Authorization": given}, body)
    assert code == 403
    with o80.Frontend(segment, read_only=True) as frontend:
        assert frontend.halted is None


@pytest.mark.parametrize(
    "foreign",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_a_page_of_another_site_is_refused_even_with_the_token(
    server: PageServer, foreign: dict[str, str]
) -> None:
    for method, target in (("GET", f"/?token={server.token}"), ("POST", "/look")):
        code, text = ask(server, method, target, bearer(server, **foreign), "{}")
        assert code == 403
        assert "another site" in text


def test_a_name_that_another_site_points_here_is_refused(server: PageServer) -> None:
    code, text = ask(server, "POST", "/look", bearer(server, Host="evil.example"), "{}")
    assert code == 403
    assert "Host" in text
    host = f"localhost:{server.port}"
    assert ask(server, "POST", "/look", bearer(server, Host=host), "{}")[0] == 200


@pytest.mark.parametrize(
    ("origin", "token"),
    [("https://evil.example", True), ("https://evil.example", False), (None, False)],
)
def test_an_upgrade_is_refused_before_it_happens(
    server: PageServer, origin: str | None, token: bool
) -> None:
    query = f"?token={server.token}" if token else ""
    own = f"http://127.0.0.1:{server.port}"
    first = raw(
        server,
        f"GET /{query} HTTP/1.1",
        f"Host: 127.0.0.1:{server.port}",
        f"Origin: {origin or own}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    )
    assert first == "HTTP/1.1 403 Forbidden"


@pytest.mark.parametrize(
    "path",
    ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/page/main.js", "/\\"],
)
def test_there_is_no_file_to_reach(server: PageServer, path: str) -> None:
    first = raw(
        server,
        f"GET {path}?token={server.token} HTTP/1.1",
        f"Host: 127.0.0.1:{server.port}",
    )
    assert first == "HTTP/1.1 404 Not Found"


def test_invalid_requests_are_answered(server: PageServer) -> None:
    assert ask(server, "POST", "/look", bearer(server), "[]")[0] == 400
    assert ask(server, "POST", "/look", bearer(server), "{")[0] == 400
    assert ask(server, "POST", "/look", bearer(server), "[" * 60000)[0] == 400
    assert ask(server, "POST", "/other", bearer(server), "{}")[0] == 404
    large = bearer(server, **{"Content-Length": str(LARGEST_REQUEST + 1)})
    assert ask(server, "POST", "/look", large)[0] == 413
    wrongs: list[dict[str, Any]] = [{"at": "noon"}, {"at": 1e300}, {"at": {}}]
    for wrong in [*wrongs, {"window": -1, "curves": True}]:
        code, answer = post(server, "/look", wrong)
        assert code == 400, answer
    assert post(server, "/look", {})[0] == 200, "the server still answers"


def test_a_halt_is_always_allowed_and_a_resume_only_with_control(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process, process.frontend() as frontend:
        with page_server([segment]) as server:
            code, answer = post(server, "/halt", {"segment": segment, "reason": "the ball"})
            assert code == 200
            frontend.wait_for(frontend.published + 2, timeout=TIMEOUT)
            halt = frontend.halted
            assert halt is not None
            assert halt.number == answer["halt"]
            assert halt.text == "the ball"
            code, answer = post(server, "/resume", {"segment": segment, "number": halt.number})
            assert code == 409
            assert "--control" in answer["error"]
            assert frontend.halted is not None
        with page_server([segment], control=True) as server:
            body = {"segment": segment, "number": halt.number}
            assert post(server, "/resume", body) == (200, {})
            assert frontend.halted is None


def test_only_shown_segments_are_halted(server: PageServer) -> None:
    with o80.robots.load("two_joints").start() as other, other.frontend() as frontend:
        code, answer = post(server, "/halt", {"segment": other.segment})
        assert code == 409
        assert "does not show" in answer["error"]
        assert frontend.halted is None


def test_a_taken_port_is_an_error(server: PageServer) -> None:
    with (
        pytest.raises(o80.Error, match=f"port {server.port} .* is taken"),
        page_server([], port=server.port),
    ):
        pass


def test_the_server_listens_on_this_computer_alone(server: PageServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert server.url.startswith(f"http://127.0.0.1:{server.port}/?token=")
    assert len(server.token) >= 32


def test_many_idle_connections_do_not_keep_a_page_out_for_ever(server: PageServer) -> None:
    idle = [socket.create_connection(("127.0.0.1", server.port), TIMEOUT) for _ in range(120)]
    for connection in idle:
        connection.close()
    for _ in range(100):
        try:
            assert post(server, "/look", {})[0] == 200
            return
        except OSError:
            continue
    raise AssertionError("the server refuses all connections")
