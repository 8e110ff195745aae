"""The HTTP server of the page. Pages ask for what they show; nothing is sent unasked.

A page sends its next request after it has shown the answer to the last one. So a page that stalls
finds one old answer at most, however long it stalled, and a slow page costs the server less.
"""

import contextlib
import errno
import json
import secrets
import socket
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

import o80
from o80.view.guard import ANY, Guard
from o80.view.page_text import page_text

LARGEST_REQUEST = 1 << 16  # [bytes]
IDLE = 30.0  # until an unused connection is closed [s]
MOST_CONNECTIONS = 100

Answer = Callable[[dict[str, Any]], dict[str, Any]]


class PageServer(ThreadingHTTPServer):
    """Serves one page and its requests, given by path. Raises o80.Error if the port is taken."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 32

    def __init__(self, host: str, port: int, answers: Mapping[str, Answer]) -> None:
        self._connections: set[socket.socket] = set()
        self._lock = threading.Lock()
        try:
            found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM)
            self.address_family = found[0][0]
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise o80.Error(_why_not(host, port, error)) from error
        self.token = secrets.token_urlsafe(24)
        self.port: int = self.server_address[1]
        self.host = host
        self.guard = Guard(host, self.port, self.token)
        self.answers = answers
        self.page = page_text()

    @property
    def url(self) -> str:
        """The address of the page, with its token."""
        host = socket.gethostname() if self.host in ANY else self.host
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self.port}/?token={self.token}"

    def process_request(self, request: Any, client_address: Any) -> None:
        with self._lock:
            full = len(self._connections) >= MOST_CONNECTIONS
            if not full:
                self._connections.add(request)
        if full:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        with self._lock:
            self._connections.discard(request)
        super().shutdown_request(request)

    def server_close(self) -> None:
        """Stops listening, and ends the connections that pages keep."""
        super().server_close()
        with self._lock:
            for connection in self._connections:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that was closed while an answer was sent is no error."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server_version = "o80"
    sys_version = ""
    timeout = IDLE
    wbufsize = 1 << 18  # head and body in one write
    disable_nagle_algorithm = True
    server: PageServer

    def do_GET(self) -> None:
        if self._refused():
            return
        if urlsplit(self.path).path != "/":
            self._send(404, "text/plain", b"there is one page only: /")
            return
        self._send(200, "text/html", self.server.page.html, policy=self.server.page.policy)

    def do_POST(self) -> None:
        if self._refused():
            return
        answer = self.server.answers.get(urlsplit(self.path).path)
        if answer is None:
            self._send(404, "text/plain", b"unknown request")
            return
        asked = self._body()
        if asked is None:
            return
        try:
            code, body = 200, answer(asked)
        except o80.Error as error:
            code, body = 409, {"error": str(error)}
        except (TypeError, ValueError, KeyError) as error:
            code, body = 400, {"error": f"invalid request: {error}"}
        self._send(code, "application/json", json.dumps(body).encode())

    def _body(self) -> dict[str, Any] | None:
        """The JSON object of a request; None after an answer to an invalid one."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > LARGEST_REQUEST:
            self.close_connection = True
            self._send(413, "text/plain", b"the request is too large")
            return None
        with contextlib.suppress(ValueError, RecursionError):
            asked = json.loads(self.rfile.read(int(length)))
            if isinstance(asked, dict):
                return asked
        self._send(400, "text/plain", b"the request must be a JSON object")
        return None

    def _refused(self) -> bool:
        """Before anything else, also before an upgrade: there is none."""
        why = self.server.guard.refusal(self.path, dict(self.headers.items()))
        if not why:
            return False
        self.close_connection = True  # its body is not read
        self._send(403, "text/plain", f"refused: {why}\n".encode())
        return True

    def _send(self, code: int, kind: str, body: bytes, policy: str = "default-src 'none'") -> None:
        self.send_response(code)
        for name, value in (
            ("Content-Type", f"{kind}; charset=utf-8"),
            ("Content-Length", str(len(body))),
            ("Content-Security-Policy", policy),
            ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"),  # the address holds the token
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "DENY"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not printed: addresses hold the token."""


def _why_not(host: str, port: int, error: Exception) -> str:
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is taken: choose another --port, or 0 for any free one"
    if isinstance(error, OverflowError):
        return f"port must be from 0 to 65535, got {port}"
    return f"cannot listen on {host}, port {port}: {getattr(error, 'strerror', None) or error}"
