"""Decides which requests a page may make: those with the token, from its own address."""

import hmac
from collections.abc import Mapping
from urllib.parse import parse_qs

ANY = ("0.0.0.0", "::", "")


class Guard:
    """Checks host, origin and token of requests.

    host: address that the server listens on. A server for all addresses accepts any name in the
        header Host, since it cannot know its own names.
    """

    def __init__(self, host: str, port: int, token: str) -> None:
        names = {host, "127.0.0.1", "localhost", "[::1]"} if is_loopback(host) else {host}
        bracketed = {f"[{name}]" if ":" in name and name[0] != "[" else name for name in names}
        self._hosts = None if host in ANY else {f"{name}:{port}".lower() for name in bracketed}
        self._token = token.encode()

    def refusal(self, query: str, headers: Mapping[str, str]) -> str:
        """Returns why a request is refused; empty: it is not. headers: by name in lower case."""
        host = headers.get("host", "").lower()
        if self._hosts is not None and host not in self._hosts:
            return "the header Host names another server"
        origin = headers.get("origin")
        if origin is not None and origin.lower() != f"http://{host}":
            return "the request comes from a page of another site"
        if headers.get("sec-fetch-site", "none") not in ("none", "same-origin"):
            return "the request comes from a page of another site"
        if not self._has_token(query, headers):
            return "the token is missing or wrong: open the address that o80 view printed"
        return ""

    def _has_token(self, query: str, headers: Mapping[str, str]) -> bool:
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer":
            given = parse_qs(query).get("token", [""])[0]
        return hmac.compare_digest(given.encode(errors="replace"), self._token)


def is_loopback(host: str) -> bool:
    """True for an address that only this computer can reach."""
    return host in ("localhost", "::1") or host.startswith("127.")
