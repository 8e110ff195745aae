"""Simulates bus servos on a pseudo-terminal; subclasses add the protocol.

`FakeChain` answers in a thread. Simulated time follows the clock, or advances by a period for
each reading of all servos, so that tests depend on no clock. Methods inject faults.
"""

import math
import os
import random
import select
import threading
import time
import tty
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, Generic, Self, TypeVar

TURN = 4096
BYTE = 10e-6  # duration at 1 Mbaud [s]
EVERYBODY = 254
Register = tuple[int, int]  # address, size


class FakeServo:
    """Registers, and a motor with limits of speed, acceleration and strength."""

    MODEL: ClassVar[Register]
    ID: ClassVar[Register]
    MODE: ClassVar[Register]
    TORQUE: ClassVar[Register]
    GOAL: ClassVar[Register]
    POSITION: ClassVar[Register]
    VOLTAGE: ClassVar[Register]
    TEMPERATURE: ClassVar[Register]
    KEPT: ClassVar[int]  # registers below this address are persistent
    AS_DELIVERED: ClassVar[dict[Register, int]]

    def __init__(self, number: int) -> None:
        self.encoder = TURN / 2  # position of the axis [steps]
        self.speed = 0.0  # [steps/s]
        self.pull = 0.0  # external load: speed of the axis without strength [steps/s]
        self.needs = 0.0  # strength needed to hold against the load, 0 to 1
        self.alarms = 0  # alarms set by a test
        self.unheard = 0.0  # since the last instruction [s]
        self.powered = True
        self.registers = bytearray(256)
        for register, value in self.AS_DELIVERED.items():
            self.put(register, value)
        self.put(self.ID, number)
        self.eeprom = bytes(self.registers)
        self.power_up()

    def get(self, register: Register) -> int:
        address, size = register
        return int.from_bytes(self.registers[address : address + size], "little")

    def put(self, register: Register, value: int) -> None:
        address, size = register
        self.registers[address : address + size] = (value % (1 << 8 * size)).to_bytes(
            size, "little"
        )

    def power_up(self) -> None:
        """Restores the registers after a power cycle."""
        self.registers[:] = self.eeprom
        self.powered, self.speed, self.alarms = True, 0.0, 0

    def keep(self) -> None:
        """Stores the persistent registers."""
        self.eeprom = bytes(self.registers[: self.KEPT]) + self.eeprom[self.KEPT :]

    # defined by a protocol
    @property
    def torque(self) -> int:
        return self.get(self.TORQUE)

    @property
    def strength(self) -> float:
        """Share of the full strength that the registers allow."""
        raise NotImplementedError

    @property
    def shown(self) -> int:
        """Shown position [steps]."""
        raise NotImplementedError

    @property
    def status(self) -> int:
        """Status byte of each answer."""
        raise NotImplementedError

    def stand_at(self, position: int) -> None:
        """Moves the axis until the servo shows this position."""
        raise NotImplementedError

    def calibrate(self, offset: int, smallest: int, largest: int) -> None:
        raise NotImplementedError

    def overload(self) -> None:
        """Simulates an overload alarm."""
        raise NotImplementedError

    def write(self, address: int, data: bytes) -> None:
        raise NotImplementedError

    def read(self, address: int, size: int) -> bytes:
        raise NotImplementedError

    def pass_time(self, seconds: float) -> None:
        raise NotImplementedError

    def move(
        self, seconds: float, strength: float, way: float, fastest: float, acceleration: float
    ) -> None:
        """Moves the axis towards the goal, or by the load if the strength does not suffice."""
        if strength == 0 or strength < self.needs:
            self.encoder += self.pull * seconds
            self.speed = 0.0  # speed of the motor
            return
        wanted = min(fastest, math.sqrt(2 * acceleration * abs(way)), abs(way) / seconds)
        change = acceleration * seconds
        self.speed += max(-change, min(change, math.copysign(wanted, way) - self.speed))
        self.encoder += self.speed * seconds


Servo = TypeVar("Servo", bound=FakeServo)


class FakeChain(Generic[Servo]):
    """Servos on a pseudo-terminal. Its name `port` stays the same after a reconnection."""

    def __init__(
        self,
        port: Path,
        servos: Sequence[Servo],
        *,
        tick: float | None = None,
        latency: float = 0.0,
        bus_time: bool = False,
    ) -> None:
        self.port = port
        self.servos = dict(enumerate(servos, 1))
        self.tick, self.latency, self.bus_time = tick, latency, bus_time
        self.reads = 0  # group reads
        self.requests = 0
        self.cut_at: int | None = None  # number of the request that unplugs the adapter
        self.damaged = 0  # number of damaged answers
        self.goals: list[dict[int, int]] = []  # one entry per sync write
        self.silent: set[int] = set()
        self.damages = 0.0  # share of damaged answers
        self.false: dict[int, list[int]] = {}  # wrong positions in undamaged answers
        self.late: list[int] = []  # delays of the next answers, in readings
        self._held: list[tuple[int, bytes]] = []  # number of the reading that returns them
        self._dice = random.Random(1)
        self._lock = threading.RLock()
        self._passed = time.monotonic()
        self._master = -1
        self._wake, self._waker = os.pipe()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Self:
        self.plug()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        os.write(self._waker, b"x")
        self._thread.join()
        self.cut()
        os.close(self._wake)
        os.close(self._waker)

    # faults
    def cut(self) -> None:
        """Unplugs the adapter."""
        with self._lock:
            if self._master >= 0:
                os.close(self._master)
            self._master = -1
            self.port.unlink(missing_ok=True)

    def plug(self) -> None:
        """Plugs the adapter in."""
        with self._lock:
            self._master, slave = os.openpty()
            tty.setraw(slave)
            self.port.unlink(missing_ok=True)
            self.port.symlink_to(os.ttyname(slave))
            os.close(slave)  # leaves the line unopened
        with suppress(OSError):
            os.write(self._waker, b"p")

    def unplug(self, servo: int) -> None:
        """Cuts the power of a servo and of all after it in the chain."""
        with self._lock:
            for number in range(servo, len(self.servos) + 1):
                self.servos[number].powered = False

    def plug_in(self, servo: int) -> None:
        """Powers up a servo and all after it in the chain."""
        with self._lock:
            for number in range(servo, len(self.servos) + 1):
                self.servos[number].power_up()

    def wait_until_closed(self) -> None:
        """Waits until the client has closed the line and all requests are executed."""
        self._closed.wait()

    # the line
    def _serve(self) -> None:
        received = bytearray()
        while True:
            with self._lock:
                master = self._master
            watched = [self._wake] if master < 0 else [self._wake, master]
            ready, _, _ = select.select(watched, [], [], 0.05)
            if not ready:
                self._follow_clock(silent=True)
                continue
            if self._wake in ready:
                if os.read(self._wake, 1) == b"x":
                    return
                continue
            if not self._serve_once(master, received):
                self._closed.set()
                received.clear()
                time.sleep(0.005)  # polls until the line is opened

    def _serve_once(self, master: int, received: bytearray) -> bool:
        """Answers the received requests; returns False if no client has the line open."""
        with self._lock:
            if master != self._master:
                return True
            try:
                received += os.read(master, 4096)
            except OSError:
                return False
            self._closed.clear()
            answers = b"".join(map(self._answer, self._requests(received)))
            if answers:
                if self.latency:
                    time.sleep(self.latency)
                with suppress(OSError):
                    os.write(master, answers)
            return True

    def _requests(self, received: bytearray) -> list[bytes]:
        """Removes and returns all complete packets: id, instruction, parameters."""
        raise NotImplementedError

    def _serve_request(self, number: int, instruction: int, parameters: bytes) -> bytes:
        raise NotImplementedError

    def _packet(self, number: int, status: int, data: bytes) -> bytes:
        """Builds an answer."""
        raise NotImplementedError

    def _answer(self, request: bytes) -> bytes:
        self.requests += 1
        if self.requests == self.cut_at:
            self.cut()
        if self._master < 0:
            return b""
        if self.bus_time:
            time.sleep(BYTE * (len(request) + 6))
        self._follow_clock(silent=False)
        return self._serve_request(request[0], request[1], request[2:])

    def _hears(self, number: int) -> bool:
        servo = self.servos.get(number)
        return servo is not None and servo.powered and number not in self.silent

    def _answer_of(self, number: int, servo: Servo, data: bytes) -> bytes:
        packet = bytearray(self._packet(number, servo.status, data))
        if self.damages and self._dice.random() < self.damages:
            self.damaged += 1
            packet[self._dice.randrange(len(packet))] ^= 1 << self._dice.randrange(8)
        return bytes(packet)

    def _write_all(self, address: int, size: int, data: bytes) -> None:
        each = [data[i : i + size + 1] for i in range(0, len(data), size + 1)]
        for value in each:
            if self._hears(value[0]):
                self.servos[value[0]].write(address, value[1:])
        if any(servo.GOAL[0] == address for servo in self.servos.values()):
            goals = {value[0]: int.from_bytes(value[1:], "little", signed=True) for value in each}
            self.goals.append(goals)

    def _read_all(self, blocks: Sequence[tuple[int, int, int]]) -> bytes:
        """Answers a group read; blocks: number, address and size of each servo."""
        self.reads += 1
        if self.tick is not None:
            self.pass_time(self.tick, silent=False)
        found = []
        for number, address, size in blocks:
            if not self._hears(number):
                break  # the servos behind it wait for its answer
            servo = self.servos[number]
            data = bytearray(servo.read(address, size))
            if positions := self.false.get(number):
                at = servo.POSITION[0] - address
                data[at : at + 2] = positions.pop(0).to_bytes(2, "little")
            found.append(self._answer_of(number, servo, bytes(data)))
        answers = b"".join(found)
        if self.bus_time:
            time.sleep(BYTE * len(answers))
        if self.late and (after := self.late.pop(0)):
            self._held.append((self.reads + after, answers))
            answers = b""
        due = b"".join(held for at, held in self._held if at <= self.reads)
        self._held = [(at, held) for at, held in self._held if at > self.reads]
        return due + answers

    def pass_time(self, seconds: float, *, silent: bool = True) -> None:
        """Advances the simulated time, without requests (silent) or with continuous ones."""
        with self._lock:
            while seconds > 0:
                step = min(seconds, 0.01)
                for servo in self.servos.values():
                    servo.unheard = servo.unheard + step if silent else 0.0
                    servo.pass_time(step)
                seconds -= step

    def _follow_clock(self, *, silent: bool) -> None:
        if self.tick is None:
            clock = time.monotonic()
            self.pass_time(clock - self._passed, silent=silent)
            self._passed = clock
