"""Fake system bus with a RealtimeKit, in a thread, by the D-Bus protocol."""

import itertools
import os
import re
import socket
import struct
import threading
from collections.abc import Iterator
from typing import Self

_count = itertools.count()
LONGEST = 200_000  # longest time of a thread without sleep [us]
ERROR = "org.freedesktop.DBus.Error."
METHOD_RETURN, METHOD_ERROR = 2, 3
ERROR_NAME, REPLY_TO, SIGNATURE = 4, 5, 8  # fields of a message's head


class RealtimeKit:
    """Answers according to `mood`, and stores the requests.

    Moods: grants, agrees (and changes nothing), refuses, absent (no such service on the
    bus), late (no answer about a thread), silent (no answer at all), rude (closes at once).
    """

    def __init__(self, mood: str = "grants") -> None:
        self.mood = mood
        self.asked: list[tuple[int, int]] = []  #: thread, priority
        self.callers = 0
        name = f"o80-test-bus-{os.getpid()}-{next(_count)}"
        self.address = f"unix:abstract={name}"
        self._bus = socket.socket(socket.AF_UNIX)
        self._bus.bind(f"\0{name}")
        self._bus.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._bus.close()

    def _serve(self) -> None:
        while True:
            try:
                caller, _ = self._bus.accept()
            except OSError:
                return
            self.callers += 1
            with caller:
                while self.mood == "silent" and caller.recv(4096):
                    pass
                if self.mood not in ("silent", "rude"):
                    self._let_in(caller)
                    for serial, member, body in self._messages(caller):
                        if (answer := self._answer(member, body)) is not None:
                            caller.sendall(message(serial, *answer))

    def _let_in(self, caller: socket.socket) -> None:
        text = b""
        while b"BEGIN\r\n" not in text:
            text += caller.recv(1)
        # older libraries send their identity with AUTH, newer ones on request
        asks = b"DATA\r\n" if b"EXTERNAL\r\n" in text else b""
        caller.sendall(asks + b"OK 0123456789abcdef0123456789abcdef\r\nERROR\r\n")

    def _messages(self, caller: socket.socket) -> Iterator[tuple[int, str, bytes]]:
        """Reads calls: serial number, member and body of each."""
        while len(head := caller.recv(16, socket.MSG_WAITALL)) == 16:
            size, serial, fields = struct.unpack("<III", head[4:])
            rest = caller.recv(fields + -fields % 8 + size, socket.MSG_WAITALL)
            member = re.search(rb"\x03\x01s\0....(\w+)", rest, re.DOTALL)
            assert member is not None
            yield serial, member[1].decode(), rest[fields + -fields % 8 :]

    def _answer(self, member: str, body: bytes) -> tuple[str, str, bytes] | None:
        """Returns error name or "", signature and body; None: no answer."""
        if member == "Hello":
            return "", "s", string(":1.1")
        if self.mood == "absent":
            return ERROR + "ServiceUnknown", "s", string("no such service")
        if member == "Get":
            if b"RTTimeUSecMax" in body:
                return "", "v", struct.pack("<B2sxxxxxq", 1, b"x\0", LONGEST)
            return "", "v", struct.pack("<B2sxi", 1, b"i\0", 20)
        assert member == "MakeThreadRealtime"
        thread, priority = struct.unpack("<QI", body)
        self.asked.append((thread, priority))
        if self.mood == "late":
            return None
        if self.mood == "refuses":
            return ERROR + "AccessDenied", "s", string("not you")
        if self.mood == "grants":
            policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
        return "", "", b""


def string(text: str) -> bytes:
    return struct.pack(f"<I{len(text) + 1}s", len(text), text.encode())


def message(serial: int, error: str, signature: str, body: bytes) -> bytes:
    """Encodes the answer to the call with this serial number."""
    fields = bytes([REPLY_TO, 1, ord("u"), 0]) + struct.pack("<I", serial)
    if error:
        fields += bytes([ERROR_NAME, 1, ord("s"), 0]) + string(error)
        fields += bytes(-len(fields) % 8)
    if signature:
        fields += bytes([SIGNATURE, 1, ord("g"), 0, len(signature)]) + signature.encode() + b"\0"
    kind = METHOD_ERROR if error else METHOD_RETURN
    head = struct.pack("<cBBBIII", b"l", kind, 1, 1, len(body), serial + 1000, len(fields))
    return head + fields + bytes(-len(fields) % 8) + body
