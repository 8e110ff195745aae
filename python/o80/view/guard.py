"""Decides which requests a page may make: those with the token, from its own address."""

import hmac
from collections.abc import Mapping
from urllib.parse import parse_qs, urlsplit

ANY = ("0.0.0.0", "::", "")


class Guard:
    """Checks host, origin and token of requests.

    host: address that the server listens on. A server for all addresses accepts any name in the
        header Host, since it cannot know its own names.
    """

    def __init__(self, host: str, port: int, token: str) -> None:
        names = {host, "127.0.0.1", "localhost", "[::1]"} if is_loopback(host) else {host}
        bracketed = {f"[{name}]" if ":" in name and name[0] != "[" else name for name in names}
        self._hosts = None if host in ANY else {f"{name}:{port}" for name in bracketed}
        self._token = token.encode()

    def refusal(self, target: str, headers: Mapping[str, str]) -> str:
        """Why a request is refused; empty if it is not. target: path and query."""
        host = headers.get("Host", "")
        if self._hosts is not None and host not in self._hosts:
            return "the header Host names another server"
        origin = headers.get("Origin")
        if origin is not None and origin != f"http://{host}":
            return "the request comes from a page of another site"
        if headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            return "the request comes from a page of another site"
        if not self._has_token(target, headers):
            return "the token is missing or wrong: open the address that o80 view printed"
        return ""

    def _has_token(self, target: str, headers: Mapping[str, str]) -> bool:
        scheme, _, given = headers.get("Authorization", "").partition(" ")
        if scheme != "Bearer":
            given = parse_qs(urlsplit(target).query).get("token", [""])[0]
        return hmac.compare_digest(given.encode(errors="replace"), self._token)


def is_loopback(host: str) -> bool:
    """True for an address that only this computer can reach."""
    return host in ("localhost", "::1") or host.startswith("127.")
