"""The connections of the server: who is let in, and who must go.

A halt must come through whatever else connects. So one thread, which never waits for a connection,
reads the heads of all requests. A connection is a stranger until it has sent a head with the token.
Then it is a holder, and a thread reads the body and sends the answer. Each kind has a budget of
its own: too many strangers cost the oldest stranger its connection, never a holder. Each round
reads all holders, then lets a few new connections in, then reads a few strangers.
"""

import contextlib
import errno
import resource
import select
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable

from o80.view.head import LARGEST_HEAD, LARGEST_REQUEST, Head, Refused, take_head
from o80.view.reply import Reply

MAX_STRANGERS = 1024
MAX_HOLDERS = 100
ACCEPTED_AT_ONCE = 16  # in a round
READ_AT_ONCE = 8  # strangers, in a round

HEAD_WITHIN = 5.0  # all of it, however its bytes are spread [s]
BODY_WITHIN = 10.0  # [s]
SENT_WITHIN = 30.0  # an answer [s]
IDLE = 30.0  # until an unused connection of a holder is closed [s]
REFUSED_AFTER = 1.0  # so that a client that asks again and again costs little [s]
CLOSED_AFTER = 2.0  # once it was told, if its client does not close it [s]
TICK = 0.1  # [s]

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
NO_MORE = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class Gate:
    """Serves the connections of one listening socket.

    refusal: why a request is refused, by its head; empty if it is not.
    reply: answers a request with the token, in a thread.
    """

    def __init__(
        self,
        listener: socket.socket,
        refusal: Callable[[Head], str],
        reply: Callable[[Head, bytes], Reply],
    ) -> None:
        self._listener = listener
        self._refusal = refusal
        self._reply = reply
        # half of the descriptors are left to the answers, which open segments and files
        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        share = limit // 4 if limit >= 0 else MAX_STRANGERS
        self._most_strangers = min(MAX_STRANGERS, share)
        self._most_holders = min(MAX_HOLDERS, share)
        # the oldest first; a holder is as old as its last request
        self._strangers: dict[_Connection, None] = {}
        self._holders: dict[_Connection, None] = {}
        self._answered: deque[_Connection] = deque()
        self._closed = False
        self._closing = threading.Lock()
        self._wake, self._woken = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for watched in (listener, self._wake, self._woken):
            watched.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ)
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._ready_strangers = select.epoll()  # the kernel gives them in turn
        self._selector.register(self._ready_strangers, selectors.EVENT_READ)
        self._watched_strangers: dict[int, _Connection] = {}  # by descriptor

    def serve(self) -> None:
        """Returns after `close`, which another thread calls."""
        expired_at = 0.0
        while not self._closed:
            ready = [key for key, _ in self._selector.select(TICK)]
            for key in ready:
                if isinstance(key.data, _Connection):
                    self._read(key.data)
            self._take_back()
            self._accept()
            for descriptor, _ in self._ready_strangers.poll(0, READ_AT_ONCE):
                if descriptor in self._watched_strangers:  # still
                    self._read(self._watched_strangers[descriptor])
            now = time.monotonic()
            if now >= expired_at + TICK:
                self._expire(now)
                expired_at = now
        self._end()

    def close(self) -> None:
        """Stops listening, and ends all connections. May be called twice."""
        self._closed = True
        self._notify()

    def _accept(self) -> None:
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                accepted, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in NO_MORE:
                    self._free_one()
                    return
                continue  # it was closed before it was accepted
            connection = _Connection(accepted, time.monotonic() + HEAD_WITHIN)
            self._strangers[connection] = None
            self._read(connection)
            self._make_room()

    def _make_room(self) -> None:
        while len(self._strangers) > self._most_strangers:
            self._drop_oldest()

    def _free_one(self) -> None:
        """The process has no descriptor left."""
        if self._strangers:
            self._drop_oldest()
        else:
            time.sleep(TICK)

    def _drop_oldest(self) -> None:
        oldest = next(iter(self._strangers))
        self._read(oldest)  # its token may have arrived meanwhile
        if oldest in self._strangers:
            self._drop(oldest)

    def _expire(self, now: float) -> None:
        for connection in [*self._strangers, *self._holders]:
            if connection.until > now or connection.busy:
                continue
            if connection.refusal:
                self._tell(connection, now)
            else:
                self._drop(connection)

    def _read(self, connection: "_Connection") -> None:
        if connection.busy or connection.closed:
            return  # since the selector named it
        try:
            data = connection.socket.recv(LARGEST_HEAD)
        except BlockingIOError:
            self._try_to_watch(connection)
            return
        except OSError:
            data = b""
        if not data and connection in self._strangers and not connection.refused:
            connection.refused = True  # closed later, as one that is told why
            connection.until = time.monotonic() + REFUSED_AFTER
            self._unwatch(connection)
        elif not data:
            self._drop(connection)
        elif connection.refused:
            connection.ignored += len(data)
            if connection.ignored > LARGEST_REQUEST:
                self._drop(connection)
        else:
            if connection in self._holders and not connection.received:
                connection.until = time.monotonic() + HEAD_WITHIN
            connection.received += data
            self._consider(connection)

    def _consider(self, connection: "_Connection") -> None:
        """Obeys or refuses what was received, if it is a whole head."""
        try:
            head = take_head(connection.received, connection.checked)
            connection.checked = 0 if head else len(connection.received)
            if head is None:
                self._watch(connection)
            elif why := self._refusal(head):
                self._refuse(connection, Refused(403, f"refused: {why}"))
            else:
                self._begin(connection, head)
        except Refused as refused:
            self._refuse(connection, refused)
        except Exception:  # such as no thread: it costs this connection, not the others
            self._drop(connection)

    def _refuse(self, connection: "_Connection", refused: Refused) -> None:
        connection.refused = True
        connection.refusal = Reply(refused.code, f"{refused}\n".encode()).as_bytes(last=True)
        connection.received.clear()
        connection.until = time.monotonic() + REFUSED_AFTER
        self._try_to_watch(connection)

    def _tell(self, connection: "_Connection", now: float) -> None:
        """Says why it is refused. Closed later: with unread bytes the answer would be lost."""
        try:
            connection.socket.send(connection.refusal)
            connection.socket.shutdown(socket.SHUT_WR)
        except OSError:
            self._drop(connection)
        connection.refusal = b""
        connection.until = now + CLOSED_AFTER

    def _begin(self, connection: "_Connection", head: Head) -> None:
        self._strangers.pop(connection, None)
        self._holders.pop(connection, None)
        if len(self._holders) >= self._most_holders:
            self._drop(next(iter(self._holders)))
        self._holders[connection] = None
        self._unwatch(connection)
        threading.Thread(target=self._answer, args=(connection, head), daemon=True).start()
        connection.busy = True

    def _answer(self, connection: "_Connection", head: Head) -> None:
        """In a thread of its own."""
        connection.last = head.last or head.method == "HEAD"  # an answer to that has no body
        try:
            if "expect" in head.headers:
                connection.send(CONTINUE)
            body = connection.body(min(head.length, LARGEST_REQUEST))
            reply = self._reply(head, body)
            connection.skip(head.length - len(body))  # with unread bytes the answer would be lost
            connection.send(reply.as_bytes(last=connection.last))
        except Exception:  # its client went or was too slow, or the answer failed
            connection.last = True
        with self._closing:
            if self._closed:
                connection.close()
                return
            self._answered.append(connection)
        self._notify()

    def _take_back(self) -> None:
        """Connections whose request is answered."""
        with contextlib.suppress(BlockingIOError):
            self._woken.recv(1 << 12)
        while self._answered:
            connection = self._answered.popleft()
            connection.busy = False
            if connection.last or connection not in self._holders:
                self._drop(connection)
                continue
            connection.socket.setblocking(False)
            connection.until = time.monotonic() + (HEAD_WITHIN if connection.received else IDLE)
            self._consider(connection)

    def _watch(self, connection: "_Connection") -> None:
        if connection.watched:
            return
        if connection in self._holders:
            self._selector.register(connection.socket, selectors.EVENT_READ, connection)
        else:
            self._ready_strangers.register(connection.socket, select.EPOLLIN)
            self._watched_strangers[connection.socket.fileno()] = connection
        connection.watched = True

    def _try_to_watch(self, connection: "_Connection") -> None:
        """Drops it if the user may watch no more: that costs this connection, not the others."""
        try:
            self._watch(connection)
        except OSError:
            self._drop(connection)

    def _unwatch(self, connection: "_Connection") -> None:
        if not connection.watched:
            return
        if self._watched_strangers.pop(connection.socket.fileno(), None) is connection:
            self._ready_strangers.unregister(connection.socket)
        else:
            self._selector.unregister(connection.socket)
        connection.watched = False

    def _drop(self, connection: "_Connection") -> None:
        self._strangers.pop(connection, None)
        self._holders.pop(connection, None)
        if connection.busy:
            connection.interrupt()
        else:
            self._unwatch(connection)
            connection.close()

    def _notify(self) -> None:
        with contextlib.suppress(OSError):  # full: it is awake anyway
            self._wake.send(b"\0")

    def _end(self) -> None:
        with self._closing:
            for connection in [*self._answered]:
                connection.busy = False  # its thread has ended
        for connection in [*self._strangers, *self._holders, *self._answered]:
            self._drop(connection)
        self._selector.close()
        self._ready_strangers.close()
        for each in (self._listener, self._wake, self._woken):
            each.close()


class _Connection:
    """Belongs to the thread of the gate, while it is busy to the thread that answers."""

    def __init__(self, accepted: socket.socket, until: float) -> None:
        self.socket = accepted
        self.socket.setblocking(False)
        with contextlib.suppress(OSError):
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.until = until  # it is closed then, if it is not busy [s]
        self.received = bytearray()
        self.checked = 0  # so many received bytes are no whole head
        self.refusal = b""  # still to be sent
        self.ignored = 0  # bytes after it was refused
        self.busy = self.refused = self.last = self.watched = self.closed = False

    def body(self, length: int) -> bytes:
        """Waits for the rest of a request. Raises OSError."""
        end = time.monotonic() + BODY_WITHIN
        while len(self.received) < length:
            self.received += self._more(length - len(self.received), end)
        body = bytes(self.received[:length])
        del self.received[:length]
        return body

    def skip(self, length: int) -> None:
        """Waits for more of a request, and drops it. Raises OSError."""
        end = time.monotonic() + BODY_WITHIN
        here = min(length, len(self.received))
        del self.received[:here]
        length -= here
        while length > 0:
            length -= len(self._more(min(length, LARGEST_REQUEST), end))

    def _more(self, most: int, end: float) -> bytes:
        left = end - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self.socket.settimeout(left)
        data = self.socket.recv(most)
        if not data:
            raise ConnectionError
        return data

    def send(self, data: bytes) -> None:
        """Waits until all is sent. Raises OSError."""
        self.socket.settimeout(SENT_WITHIN)  # for all of it
        self.socket.sendall(data)

    def interrupt(self) -> None:
        """Makes its thread end; from another one."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.closed = True
        self.socket.close()
