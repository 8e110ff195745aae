"""The head of a request.

A head that two programs could read differently is refused. Digits are counted before they become a
number.
"""

import re
from dataclasses import dataclass

from o80.base.errors import Error

LARGEST_HEAD = 1 << 14  # [bytes]
LARGEST_REQUEST = 1 << 16  # of the body [bytes]; a longer halt is read up to here
HALT = "/halt"

TOO_LARGE = f"the request is larger than {LARGEST_REQUEST} bytes"

_END = b"\r\n\r\n"
# a control character, LF without CR, CR without LF; the last CR may still lack its LF
_WRONG = re.compile(rb"[\0-\x08\x0b\x0c\x0e-\x1f\x7f]|(?<!\r)\n|\r(?!\n|\Z)")
_FIRST_LINE = re.compile(r"([A-Z]{1,20}) (/[!-~]*) HTTP/1\.([01])")
_NAME = re.compile(r"[\w!#$%&'*+.^`|~-]+", re.ASCII)
_LENGTH = re.compile(r"[0-9]+")
_MOST_DIGITS = 15  # of the content length of a halt


class Refused(Error):  # noqa: N818
    """A request is refused because of its head."""

    def __init__(self, code: int, why: str) -> None:
        super().__init__(why)
        self.code = code


@dataclass(frozen=True)
class Head:
    """A request without its body."""

    method: str
    path: str
    query: str
    headers: dict[str, str]  #: by name in lower case
    length: int  #: length of the body [bytes]
    last: bool  #: the connection is closed after the answer


def take_head(received: bytearray, checked: int) -> Head | None:
    """Removes a head from the begin of the received bytes; None while it is incomplete.

    checked: bytes that were searched before. Raises Refused for an invalid head, also incomplete.
    """
    end = received.find(_END, max(0, checked - len(_END) + 1))
    stop = min(len(received) if end < 0 else end + len(_END), LARGEST_HEAD)
    if _WRONG.search(received, max(0, checked - 1), stop):
        raise Refused(400, "the head has a control character, or a line that ends without CR LF")
    if end > LARGEST_HEAD or (end < 0 and len(received) > LARGEST_HEAD):
        raise Refused(431, f"the head is longer than {LARGEST_HEAD} bytes")
    if end < 0:
        return None
    first, *lines = received[:end].decode("latin-1").split("\r\n")
    del received[: end + len(_END)]
    asked = _FIRST_LINE.fullmatch(first)
    if asked is None:
        raise Refused(400, "the first line must be: METHOD /path HTTP/1.1")
    method, target, minor = asked.groups()
    headers = _headers(lines)
    path, _, query = target.partition("?")
    last = minor == "0" or "close" in headers.get("connection", "").lower()
    return Head(method, path, query, headers, _length(headers, path), last)


def _headers(lines: list[str]) -> dict[str, str]:
    headers: dict[str, str] = {}
    for number, line in enumerate(lines, 2):
        name, colon, value = line.partition(":")
        if not colon or not _NAME.fullmatch(name):
            raise Refused(400, f"line {number} of the head is not: Name: value")
        name = name.lower()
        if name in headers:
            raise Refused(400, f"the header {name} is given twice")
        headers[name] = value.strip(" \t")
    if "host" not in headers:
        raise Refused(400, "the header Host is missing")
    return headers


def _length(headers: dict[str, str], path: str) -> int:
    if "transfer-encoding" in headers:
        raise Refused(400, "Transfer-Encoding is not supported: send a Content-Length")
    digits = headers.get("content-length", "0")
    if not _LENGTH.fullmatch(digits):
        raise Refused(400, "Content-Length must be digits")
    most_digits = _MOST_DIGITS if path == HALT else len(str(LARGEST_REQUEST))
    if len(digits) > most_digits or (path != HALT and int(digits) > LARGEST_REQUEST):
        raise Refused(413, TOO_LARGE)
    return int(digits)
