"""The connections of the server: which are accepted, and which are dropped.

A halt must get through whatever else connects. A connection is a stranger until it has sent a head
with the token; then it is a holder. Each kind has a budget of its own: too many strangers drop the
oldest stranger, never a holder. One thread, the loop of asyncio, reads them all: in each round all
holders, a few new connections and a few strangers. A thread of its own computes each answer.
"""

import asyncio
import contextlib
import errno
import resource
import select
import socket
import threading
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
RETRIED_AFTER = 0.1  # until a connection is accepted again, without a free descriptor [s]

CONTINUE = b"HTTP/1.1 100 Continue\r\n\r\n"
NO_MORE = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


class Gate:
    """Serves the connections of one listening socket.

    refusal: returns why a request is refused, by its head; empty if it is not.
    reply: answers a request with the token, in a thread; raises nothing.
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
        self._strangers: dict[int, _Stranger] = {}  # by descriptor
        self._holders: dict[asyncio.Task[None], None] = {}
        self._ready_strangers = select.epoll()  # the kernel returns them in turn
        self._loop = asyncio.new_event_loop()
        self._end = asyncio.Event()

    def serve(self) -> None:
        """Serves until another thread calls `close`."""
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # it ends all holders
            runner.run(self._serve())

    def close(self) -> None:
        """Stops listening, and ends all connections. May be called twice."""
        with contextlib.suppress(RuntimeError):  # it has ended
            self._loop.call_soon_threadsafe(self._end.set)

    async def _serve(self) -> None:
        self._listener.setblocking(False)
        self._loop.add_reader(self._listener, self._accept)
        self._loop.add_reader(self._ready_strangers, self._read_strangers)
        await self._end.wait()
        for watched in (self._listener, self._ready_strangers):
            self._loop.remove_reader(watched)
            watched.close()
        for stranger in [*self._strangers.values()]:
            self._drop(stranger)

    # ------------------------------------------------------------------ strangers

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
                    self._loop.remove_reader(self._listener)
                    retry = self._loop.add_reader
                    self._loop.call_later(RETRIED_AFTER, retry, self._listener, self._accept)
                return
            accepted.setblocking(False)
            stranger = _Stranger(accepted)
            stranger.next = self._loop.call_later(HEAD_WITHIN, self._drop, stranger)
            self._strangers[accepted.fileno()] = stranger
            try:
                self._ready_strangers.register(accepted, select.EPOLLIN)
            except OSError:  # the user's limit of watches is reached
                self._drop(stranger)
                continue
            self._read(stranger)
            while len(self._strangers) > self._most_strangers:
                self._drop_oldest()

    def _read_strangers(self) -> None:
        for descriptor, _ in self._ready_strangers.poll(0, READ_AT_ONCE):
            if descriptor in self._strangers:
                self._read(self._strangers[descriptor])

    def _read(self, stranger: "_Stranger") -> None:
        """Serves or refuses a request as soon as its whole head was received."""
        try:
            data = stranger.socket.recv(LARGEST_HEAD)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._close_later(stranger, None)  # like a connection that gets a reason
            return
        stranger.received += data
        try:
            head = self._take_head(stranger.received, stranger.checked)
        except Refused as refused:
            self._close_later(stranger, refused)
            return
        stranger.checked = len(stranger.received)
        if head is not None:
            self._forget(stranger)
            self._hold(stranger.socket, stranger.received, head)

    def _take_head(self, received: bytearray, checked: int) -> Head | None:
        """Removes a head; None while it is incomplete. Raises Refused, also without the token."""
        head = take_head(received, checked)
        if head is not None and (why := self._refusal(head)):
            raise Refused(403, f"refused: {why}")
        return head

    def _close_later(self, stranger: "_Stranger", refused: Refused | None) -> None:
        self._unwatch(stranger)
        stranger.next.cancel()
        stranger.next = self._loop.create_task(_refuse(stranger.socket, refused))
        stranger.next.add_done_callback(lambda _: self._drop(stranger))

    def _unwatch(self, stranger: "_Stranger") -> None:
        with contextlib.suppress(OSError, ValueError):  # it is not watched, or the gate has ended
            self._ready_strangers.unregister(stranger.socket)

    def _forget(self, stranger: "_Stranger") -> None:
        self._unwatch(stranger)
        self._strangers.pop(stranger.socket.fileno(), None)
        stranger.next.cancel()

    def _drop(self, stranger: "_Stranger") -> None:
        self._forget(stranger)
        stranger.socket.close()

    def _drop_oldest(self) -> None:
        oldest = next(iter(self._strangers.values()))
        if isinstance(oldest.next, asyncio.TimerHandle):  # it is not refused
            self._read(oldest)  # its token may have arrived meanwhile
        if self._strangers.get(oldest.socket.fileno()) is oldest:
            self._drop(oldest)

    # ------------------------------------------------------------------ holders

    def _hold(self, connection: socket.socket, received: bytearray, head: Head) -> None:
        if len(self._holders) >= self._most_holders:
            oldest = next(iter(self._holders))
            del self._holders[oldest]
            oldest.cancel()
        holder = self._loop.create_task(self._converse(connection, received, head))
        self._holders[holder] = None

        def end(_: object) -> None:
            self._holders.pop(holder, None)
            connection.close()

        holder.add_done_callback(end)

    async def _converse(self, connection: socket.socket, received: bytearray, head: Head) -> None:
        """Answers the requests of a holder, one after the other."""
        try:
            while not await self._answered(connection, received, head):
                async with asyncio.timeout(IDLE):
                    while not received:
                        await _receive(connection, received)
                head = await self._next_head(connection, received)
        except Refused as refused:
            await _refuse(connection, refused)
        except Exception:  # the client left or was too slow, or no thread could be started
            return

    async def _next_head(self, connection: socket.socket, received: bytearray) -> Head:
        checked = 0
        async with asyncio.timeout(HEAD_WITHIN):
            while (head := self._take_head(received, checked)) is None:
                checked = len(received)
                await _receive(connection, received)
        this: asyncio.Task[None] | None = asyncio.current_task()
        assert this is not None
        if this in self._holders:  # it is the youngest now
            self._holders[this] = self._holders.pop(this)
        return head

    async def _answered(self, connection: socket.socket, received: bytearray, head: Head) -> bool:
        """Answers one request; returns whether it was the last one."""
        length = min(head.length, LARGEST_REQUEST)
        async with asyncio.timeout(BODY_WITHIN):
            if "expect" in head.headers:
                await self._loop.sock_sendall(connection, CONTINUE)
            while len(received) < length:
                await _receive(connection, received)
        body = bytes(received[:length])
        reply = await self._computed(head, body)
        async with asyncio.timeout(BODY_WITHIN):  # with unread bytes the answer would be lost
            left = head.length
            while len(received) < left:
                left -= len(received)
                received.clear()
                await _receive(connection, received)
        del received[:left]
        is_last = head.last or head.method == "HEAD"  # an answer to HEAD has no body
        async with asyncio.timeout(SENT_WITHIN):
            await self._loop.sock_sendall(connection, reply.as_bytes(last=is_last))
        return is_last

    async def _computed(self, head: Head, body: bytes) -> Reply:
        """Computes an answer in a thread of its own: others may hang."""
        computed: asyncio.Future[Reply] = self._loop.create_future()

        def give(reply: Reply) -> None:
            if not computed.done():  # the connection may have been dropped
                computed.set_result(reply)

        def compute() -> None:
            reply = self._reply(head, body)
            with contextlib.suppress(RuntimeError):  # the gate has ended
                self._loop.call_soon_threadsafe(give, reply)

        threading.Thread(target=compute, daemon=True).start()
        return await computed


class _Stranger:
    """A connection that has not shown the token."""

    def __init__(self, accepted: socket.socket) -> None:
        self.socket = accepted
        with contextlib.suppress(OSError):
            accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.received = bytearray()
        self.checked = 0  # received bytes that are known to hold no whole head
        self.next: asyncio.TimerHandle | asyncio.Task[None]  # closes it


async def _receive(connection: socket.socket, received: bytearray) -> None:
    """Waits for more bytes. Raises ConnectionError at the end."""
    await asyncio.sleep(0)  # whoever sends without a pause does not keep the others waiting
    data = await asyncio.get_running_loop().sock_recv(connection, LARGEST_HEAD)
    if not data:
        raise ConnectionError
    received += data


async def _refuse(connection: socket.socket, refused: Refused | None) -> None:
    """Sends the reason of a refusal, if there is one; ends when the connection may be closed."""
    await asyncio.sleep(REFUSED_AFTER)
    if refused is None:
        return
    with contextlib.suppress(OSError):
        connection.send(Reply(refused.code, f"{refused}\n".encode()).as_bytes(last=True))
        connection.shutdown(socket.SHUT_WR)
        await asyncio.sleep(CLOSED_AFTER)  # unread bytes would lose the answer
