"""Who may ask the server of `o80 view`, over real sockets."""

import json
import socket
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from typing import Any

import pytest
from processes import WAIT

import o80
from o80.view.head import LARGEST_HEAD, LARGEST_REQUEST, Head, Refused, take_head
from o80.view.serve import page_server
from o80.view.server import PageServer


@pytest.fixture
def server(arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageServer]:
    """One that refuses without delay."""
    monkeypatch.setattr("o80.view.gate.REFUSED_AFTER", 0.0)
    arm.burst(5)
    with page_server([arm.segment]) as server:
        yield server


def ask(
    server: PageServer, method: str, target: str, headers: dict[str, str], body: str = ""
) -> tuple[int, str]:
    connection = HTTPConnection("127.0.0.1", server.port, timeout=WAIT)
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


def test_the_page_comes_with_the_token_alone(server: PageServer) -> None:
    assert server.url == f"http://127.0.0.1:{server.port}/?token={server.token}"
    assert len(server.token) >= 32
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
def test_no_request_is_obeyed_without_the_token(
    server: PageServer, arm: o80.Frontend, path: str, given: str
) -> None:
    body = json.dumps({"segment": arm.segment})
    code, _ = ask(server, "POST", path, {"Authorization": given}, body)
    assert code == 403
    assert not halted(arm)


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
    "path",
    ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/page/main.js", "/\\"],
)
def test_there_is_no_file_to_reach(server: PageServer, arm: o80.Frontend, path: str) -> None:
    first = f"GET {path}?token={server.token} HTTP/1.1"
    answer = answer_to(server, request(server, arm, "Connection: close", first=first))
    assert answer.startswith("HTTP/1.1 404 Not Found")


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
    for number in (1e400, 10**30, -(10**30)):
        assert post(server, "/resume", {"segment": "none", "number": number})[0] in (400, 409)
    assert post(server, "/look", {})[0] == 200, "the server still answers"


def test_a_halt_is_always_allowed_and_a_resume_only_with_control(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process, process.frontend() as frontend:
        with page_server([segment]) as server:
            code, answer = post(server, "/halt", {"segment": segment, "reason": "the ball"})
            assert code == 200
            frontend.wait_for(frontend.published + 2, timeout=WAIT)
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


@pytest.mark.parametrize(
    "body",
    [
        b'{"segment": "NAME", "reason": "T\xfcr"}',
        b'{"segment": "NAME", "reason": "the ball',
        b'{"segment": "NAME", "reason": the ball}',
        b'[{"segment": "NAME"}]',
        b'{"segment": "NAME", "reason": 5}',
        b'{"segment": "NAME", "reason": ["\\ud800"]}',
        b'{"segment": "NAME", "reason": "\\ud800\\u0000"}',
        b'{"segment": "NAME", "reason": "' + b"x" * 60_000 + b'"}',
        b'{"segment": "NAME", "reason": "' + b"x" * 4_000_000 + b'"}',
    ],
)
def test_a_halt_comes_whatever_is_wrong_with_its_request(
    server: PageServer, arm: o80.Frontend, body: bytes
) -> None:
    body = body.replace(b"NAME", arm.segment.encode())
    code, answer = ask(server, "POST", "/halt", bearer(server), body.decode("latin-1"))
    assert code in (200, 400, 413)
    assert json.loads(answer)["halt"] == 1
    assert halted(arm)


def test_only_shown_segments_are_halted(server: PageServer) -> None:
    with o80.robots.load("two_joints").start() as other, other.frontend() as frontend:
        code, answer = post(server, "/halt", {"segment": other.segment})
        assert code == 409
        assert "does not show" in answer["error"]
        assert frontend.halted is None


def answer_to(server: PageServer, request: str) -> str:
    """All that is sent until the server closes the connection."""
    with socket.create_connection(("127.0.0.1", server.port), WAIT) as connection:
        connection.sendall(request.encode("latin-1"))
        return connection.makefile(encoding="latin-1", newline="").read()


FIRST = "POST /halt HTTP/1.1"


def request(
    server: PageServer, arm: o80.Frontend, *more: str, first: str = FIRST, end: str = "\r\n"
) -> str:
    """A halt with the token, which would be obeyed, and with further lines."""
    body = json.dumps({"segment": arm.segment})
    own = [f"Host: 127.0.0.1:{server.port}", f"Authorization: Bearer {server.token}"]
    if not any(line.startswith("Content-Length") for line in more):
        own.append(f"Content-Length: {len(body)}")
    return end.join([first, *own, *more, "", ""]) + body


def halted(arm: o80.Frontend) -> bool:
    """Whether a halt has arrived; it acts in the next step."""
    arm.burst(1)
    return arm.halted is not None


@pytest.mark.parametrize(
    ("lines", "code"),
    [
        *(
            ([f"Content-Length: {length}"], code)
            for length, code in (
                *((text, 400) for text in ("", "-1", "+5", "1_0", "0x5", "5, 5", "5 5", "\xb2")),
                ("9" * 5000, 413),
                ("0" * 5000, 413),
            )
        ),
        *(
            ([line], 400)
            for line in (
                "Host: evil.example",
                "hOST: 127.0.0.1",
                "AUTHORIZATION: Bearer wrong",
                "Transfer-Encoding: chunked",
                "transfer-encoding: identity",
                " folded",
                "\tfolded",
                "no colon",
                ": no name",
                "Name : x",
                "Na\xefme: x",
                "X: a\0b",
                "X: a\rb",
                "X: a\r",
                "X: a\nb: c",
                "X: a\x7fb",
            )
        ),
        (["Content-Length: 5", "Content-Length: 5"], 400),
        (["Content-Length: 5", "CONTENT-LENGTH: 6"], 400),
        ([f"X: {'a' * LARGEST_HEAD}"], 431),
    ],
)
def test_a_head_that_can_be_read_in_two_ways_is_refused_and_its_connection_closed(
    server: PageServer, arm: o80.Frontend, lines: list[str], code: int
) -> None:
    answer = answer_to(server, request(server, arm, *lines))
    assert answer.startswith(f"HTTP/1.1 {code} ")
    assert answer.count("HTTP/1.1") == 1, "the rest was not read as a request"
    assert post(server, "/look", {})[0] == 200
    assert not halted(arm)


@pytest.mark.parametrize(
    "first",
    [
        "",
        "POST /halt",
        "POST /halt HTTP/2.0",
        "POST /halt HTTP/1.1 ",
        "POST  /halt HTTP/1.1",
        "POST /ha lt HTTP/1.1",
        "POST halt HTTP/1.1",
        "POST http://127.0.0.1/halt HTTP/1.1",
        "post /halt HTTP/1.1",
        "\x16\x03\x01",
    ],
)
def test_a_first_line_that_is_none_or_ends_with_one_character_is_refused(
    server: PageServer, arm: o80.Frontend, first: str
) -> None:
    assert answer_to(server, request(server, arm, first=first)).startswith("HTTP/1.1 400 ")
    assert answer_to(server, request(server, arm, end="\n")).startswith("HTTP/1.1 400 ")
    assert not halted(arm)


@pytest.mark.parametrize("written", [str.lower, str.upper, str.title, str.swapcase])
def test_the_names_of_headers_have_no_case(
    server: PageServer, written: Callable[[str], str]
) -> None:
    host = f"{written('Host')}: localhost:{server.port}"
    token = f"{written('Authorization')}: {written('Bearer')} {server.token}"
    length = f"{written('Content-Length')}: 2"
    foreign = (f"{written('Origin')}: http://evil", f"{written('Sec-Fetch-Site')}: cross-site")
    for more, code in ((), 200), (foreign[:1], 403), (foreign[1:], 403):
        close = f"{written('Connection')}: {written('Close')}"
        head = "\r\n".join(["POST /look HTTP/1.1", host, token, length, close, *more, "", ""])
        assert answer_to(server, head + "{}").startswith(f"HTTP/1.1 {code} ")


@pytest.mark.parametrize("cut", range(1, 40, 3))
def test_a_head_is_read_alike_however_it_is_cut(cut: int) -> None:
    well = b"POST /look?a=b HTTP/1.1\r\nHost: here\r\nContent-Length: 2\r\n\r\n"
    assert read_in_parts(well + b"{}", cut) == read_in_parts(well + b"{}", 1000)
    for place in range(len(well) - 4):
        for wrong in (b"\r", b"\n", b"\0", b"\r\r\n"):
            given = well[:place] + wrong + well[place:]
            assert isinstance(read_in_parts(given, 1000), int), given
            assert isinstance(read_in_parts(given, cut), int), given


def read_in_parts(given: bytes, cut: int) -> Head | int:
    """The head, or the code with which it is refused."""
    received = bytearray()
    checked = 0
    try:
        for begin in range(0, len(given), cut):
            received += given[begin : begin + cut]
            head = take_head(received, checked)
            if head is not None:
                return head
            checked = len(received)
    except Refused as refused:
        return refused.code
    raise AssertionError("the head is never complete")


def test_requests_may_follow_each_other_on_a_connection(
    server: PageServer, arm: o80.Frontend
) -> None:
    look = request(server, arm, first="POST /look HTTP/1.1")
    answer = answer_to(server, look + look + request(server, arm, "Connection: close"))
    assert answer.count("HTTP/1.1 200 OK") == 3
    assert halted(arm)
