"""The connections of the server: which are accepted, and which are dropped.

A halt must get through whatever else connects. So one thread, which never waits for a connection,
reads the heads of all requests. A connection is a stranger until it has sent a head with the token.
Then it is a holder, and a thread reads the body and sends the answer. Each kind has a budget of
its own: too many strangers drop the oldest stranger, never a holder. Each round reads all holders,
then accepts a few new connections, then reads a few strangers.
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

HEAD_WITHIN = 5.0  # timeout of the whole head [s]
BODY_WITHIN = 10.0  # [s]
SENT_WITHIN = 30.0  # an answer [s]
IDLE = 30.0  # until an unused connection of a holder is closed [s]
REFUSED_AFTER = 1.0  # delay of a refusal, so that a client that retries costs little [s]
CLOSED_AFTER = 2.0  # time after a refusal, if the client does not close the connection [s]
TICK = 0.1  # [s]

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
NO_MORE = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class Gate:
    """Serves the connections of one listening socket.

    refusal: returns why a request is refused, by its head; empty if it is not.
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
        self._ready_strangers = select.epoll()  # the kernel returns them in turn
        self._selector.register(self._ready_strangers, selectors.EVENT_READ)
        self._watched_strangers: dict[int, _Connection] = {}  # by descriptor

    def serve(self) -> None:
        """Serves until another thread calls `close`."""
        expired_at = 0.0
        while not self._closed:
            ready = [key for key, _ in self._selector.select(TICK)]
            for key in ready:
                if isinstance(key.data, _Connection):
                    self._read(key.data)
            self._take_back()
            self._accept()
            for descriptor, _ in self._ready_strangers.poll(0, READ_AT_ONCE):
                if descriptor in self._watched_strangers:  # still watched
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
                if error.errno not in NO_MORE:
                    continue  # it was closed before it was accepted
                if self._strangers:  # the process has no descriptor left: frees one
                    self._drop_oldest()
                else:
                    time.sleep(TICK)
                return
            connection = _Connection(accepted, time.monotonic() + HEAD_WITHIN)
            self._strangers[connection] = None
            self._read(connection)
            self._make_room()

    def _make_room(self) -> None:
        while len(self._strangers) > self._most_strangers:
            self._drop_oldest()

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
                self._send_refusal(connection, now)
            else:
                self._drop(connection)

    def _read(self, connection: "_Connection") -> None:
        if connection.busy or connection.closed:
            return  # since the selector reported it
        try:
            data = connection.socket.recv(LARGEST_HEAD)
        except BlockingIOError:
            self._try_to_watch(connection)
            return
        except OSError:
            data = b""
        if not data and connection in self._strangers and not connection.refused:
            connection.refused = True  # closed later, like a connection that gets a reason
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
            self._take_request(connection)

    def _take_request(self, connection: "_Connection") -> None:
        """Serves or refuses a request as soon as its whole head was received."""
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
        except Exception:  # for example no thread: it costs this connection, not the others
            self._drop(connection)

    def _refuse(self, connection: "_Connection", refused: Refused) -> None:
        connection.refused = True
        connection.refusal = Reply(refused.code, f"{refused}\n".encode()).as_bytes(last=True)
        connection.received.clear()
        connection.until = time.monotonic() + REFUSED_AFTER
        self._try_to_watch(connection)

    def _send_refusal(self, connection: "_Connection", now: float) -> None:
        """Sends the reason of a refusal. Closed later: unread bytes would lose the answer."""
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
        """Answers a request, in a thread of its own."""
        connection.last = head.last or head.method == "HEAD"  # an answer to HEAD has no body
        try:
            if "expect" in head.headers:
                connection.send(CONTINUE)
            body = connection.body(min(head.length, LARGEST_REQUEST))
            reply = self._reply(head, body)
            connection.skip(head.length - len(body))  # with unread bytes the answer would be lost
            connection.send(reply.as_bytes(last=connection.last))
        except Exception:  # the client left or was too slow, or the answer failed
            connection.last = True
        with self._closing:
            if self._closed:
                connection.close()
                return
            self._answered.append(connection)
        self._notify()

    def _take_back(self) -> None:
        """Takes back connections whose request is answered."""
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
            self._take_request(connection)

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
        """Watches a connection; drops it if the user's limit of watches is reached."""
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
        with contextlib.suppress(OSError):  # full: the gate is awake anyway
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
    """Owned by the gate's thread, or by the answering thread while it is busy."""

    def __init__(self, accepted: socket.socket, until: float) -> None:
        self.socket = accepted
        self.socket.setblocking(False)
        with contextlib.suppress(OSError):
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.until = until  # time to close it, if it is not busy [s]
        self.received = bytearray()
        self.checked = 0  # received bytes that are known to hold no whole head
        self.refusal = b""  # reason still to be sent
        self.ignored = 0  # bytes received after it was refused
        self.busy = self.refused = self.last = self.watched = self.closed = False

    def body(self, length: int) -> bytes:
        """Waits for the rest of a request. Raises OSError if it does not arrive in time."""
        end = time.monotonic() + BODY_WITHIN
        while len(self.received) < length:
            self.received += self._more(length - len(self.received), end)
        body = bytes(self.received[:length])
        del self.received[:length]
        return body

    def skip(self, length: int) -> None:
        """Waits for more bytes of a request, drops them. Raises OSError if they do not arrive."""
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
        """Waits until all data are sent. Raises OSError if the client does not take them."""
        self.socket.settimeout(SENT_WITHIN)  # for all of it
        self.socket.sendall(data)

    def interrupt(self) -> None:
        """Makes its thread end; another thread calls it."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self.closed = True
        self.socket.close()
