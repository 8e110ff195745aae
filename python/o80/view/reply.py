"""An answer as the bytes of HTTP."""

from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

from o80.base.finite import json_text
from o80.base.screen import complain_once

NOTHING = "default-src 'none'"  # a content security policy


@dataclass(frozen=True)
class Reply:
    """Status, content and its type."""

    code: int
    body: bytes
    kind: str = "text/plain"
    policy: str = NOTHING

    @classmethod
    def json(cls, code: int, body: dict[str, Any]) -> "Reply":
        """Makes a reply whose body is JSON."""
        return cls(code, json_text(body, say=complain_once).encode(), "application/json")

    def as_bytes(self, *, last: bool) -> bytes:
        """Encodes head and body. last: the connection is closed after this reply."""
        lines = [
            f"HTTP/1.1 {self.code} {HTTPStatus(self.code).phrase}",
            "Server: o80",
            f"Content-Type: {self.kind}; charset=utf-8",
            f"Content-Length: {len(self.body)}",
            f"Content-Security-Policy: {self.policy}",
            "Cache-Control: no-store",
            "Referrer-Policy: no-referrer",  # the address holds the token
            "X-Content-Type-Options: nosniff",
            "X-Frame-Options: DENY",
            "Cross-Origin-Resource-Policy: same-origin",
            *(["Connection: close"] if last else []),
        ]
        return "\r\n".join([*lines, "", ""]).encode() + self.body
