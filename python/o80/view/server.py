"""The HTTP server of the page. Pages request their data; the server pushes nothing.

A page sends its next request after it has shown the previous answer. So after a stall a page has
one old answer at most, however long it stalled, and a slow page costs the server less.
"""

import base64
import contextlib
import errno
import hashlib
import json
import re
import secrets
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from o80.base.errors import Error
from o80.view.gate import Gate
from o80.view.guard import ANY, Guard
from o80.view.head import HALT, TOO_LARGE, Head
from o80.view.reply import Reply

BACKLOG = 4096  # connections that wait in the kernel until they are accepted

Answer = Callable[[dict[str, Any]], dict[str, Any]]


class PageServer:
    """Serves one page and its requests, given by path. Raises Error if the port is taken."""

    def __init__(self, host: str, port: int, answers: Mapping[str, Answer]) -> None:
        listener = _listen(host, port)
        self.address: str = listener.getsockname()[0]
        self.port: int = listener.getsockname()[1]
        self.host = host
        self.token = secrets.token_urlsafe(24)
        self._guard = Guard(host, self.port, self.token)
        self._answers = answers
        self._page = page_text()
        gate = Gate(listener, self._refusal, self._reply)
        self.serve = gate.serve
        self.close = gate.close

    @property
    def url(self) -> str:
        """The address of the page, with its token."""
        host = socket.gethostname() if self.host in ANY else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/?token={self.token}"

    def _refusal(self, head: Head) -> str:
        return self._guard.refusal(head.query, head.headers)

    def _reply(self, head: Head, body: bytes) -> Reply:
        if head.method == "GET":
            if head.path == "/":
                return Reply(200, self._page.html, "text/html", self._page.policy)
            return Reply(404, b"there is one page only: /")
        if head.method != "POST":
            return Reply(501, b"requests are GET or POST")
        answer = self._answers.get(head.path)
        if answer is None:
            return Reply(404, b"unknown request")
        query: Any = None
        with contextlib.suppress(ValueError, RecursionError):
            query = json.loads(body)
        wrong = not isinstance(query, dict)
        if wrong and head.path != HALT:
            return Reply(400, b"the request must be a JSON object")
        try:
            if wrong:
                done = answer(_unreadable_halt(body))
                code, why = 400, "the request must be a JSON object"
                if head.length > len(body):
                    code, why = 413, TOO_LARGE
                return Reply.json(code, done | {"error": f"it is halted, but {why}"})
            return Reply.json(200, answer(query))
        except Error as error:
            return Reply.json(409, {"error": str(error)})
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            return Reply.json(400, {"error": f"invalid request: {error}"})
        except Exception as error:
            return Reply.json(500, {"error": f"the view failed: {error!r}"})


def _unreadable_halt(body: bytes) -> dict[str, Any]:
    """Recovers the fields, at least the segment, of a halt request that is no JSON object."""
    text = body.decode(errors="replace")
    with contextlib.suppress(ValueError, RecursionError):
        query = json.loads(text)
        if isinstance(query, dict):
            return query
    found = re.search(r'"segment"\s*:\s*"([\w.-]+)"', text)
    return {"segment": found[1]} if found else {}


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((host, port))
            listener.listen(BACKLOG)
        except BaseException:
            listener.close()
            raise
    except (OSError, OverflowError, UnicodeError) as error:
        raise Error(_why_not(host, port, error)) from error
    return listener


def _why_not(host: str, port: int, error: Exception) -> str:
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is taken: choose another --port, or 0 for any free one"
    if isinstance(error, OverflowError):
        return f"port must be from 0 to 65535, got {port}"
    return f"cannot listen on {host}, port {port}: {getattr(error, 'strerror', None) or error}"


SCRIPTS = (
    *("vectors.js", "shapes.js", "scene.js", "curves.js", "lists.js", "timeline.js"),
    *("file.js", "main.js"),
)


@dataclass(frozen=True)
class Page:
    """The page and its content security policy: no script or style but its own, no other host."""

    html: bytes
    policy: str


@cache
def page_text(recording: str = "") -> Page:
    """Makes the page of `o80 view`; or, with a recording, a page that needs no server."""
    folder = files("o80.view") / "page"
    script = "".join((folder / name).read_text() for name in SCRIPTS)
    script = f'"use strict";\n{script}'
    style = (folder / "style.css").read_text()
    html = (folder / "page.html").read_text()
    html = html.replace("/* style */", style).replace("/* script */", script)
    policy = (
        f"default-src 'none'; connect-src 'self'; img-src data:; script-src '{_hash(script)}'; "
        f"style-src '{_hash(style)}'; base-uri 'none'; form-action 'none'"
    )
    if recording:
        policy = policy.replace("'self'", "'none'")
        buttons = ('id="halt"', 'id="resume"')
        lines = [line for line in html.split("\n") if not any(each in line for each in buttons)]
        meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        data = f'<script id="recording" type="text/plain">{recording}</script>'
        html = "\n".join(lines).replace("<title>", f"{meta}\n<title>")
        html = html.replace('<script>"use', f'{data}\n<script>"use')
    return Page(html.encode(), f"{policy}; frame-ancestors 'none'")


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
