"""Feetech STS3215 servos on a pseudo-terminal, as their clients see them.

`FakeChain` answers in a thread of its own. Its time passes by the clock, or by a period for each
reading of all servos, so that a test depends on no clock. Its methods break things.
"""

import math
import os
import random
import select
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path
from typing import Self

MODEL = 777
TURN = 4096
BYTE = 10e-6  # on a line of 1 Mbaud [s]
EVERYBODY = 254

# registers: address, size
FIRMWARE, MODEL_NUMBER, ID, SMALLEST, LARGEST = (0, 2), (3, 2), (5, 1), (9, 2), (11, 2)
HOTTEST, MOST_VOLTAGE, LEAST_VOLTAGE, PHASE = (13, 1), (14, 1), (15, 1), (18, 1)
OFFSET, MODE, WEAK = (31, 2), (33, 1), (34, 1)
TORQUE, ACCELERATION, GOAL, SPEED, STRENGTH = (40, 1), (41, 1), (42, 2), (46, 2), (48, 2)
LOCK, POSITION, MOVED, LOAD = (55, 1), (56, 2), (58, 2), (60, 2)
VOLTAGE, TEMPERATURE, STATUS, MOVING = (62, 1), (63, 1), (65, 1), (66, 1)
EEPROM = range(5, 40)
AS_DELIVERED = {
    FIRMWARE: 0x0903,
    MODEL_NUMBER: MODEL,
    LARGEST: 4095,
    HOTTEST: 70,
    MOST_VOLTAGE: 80,
    LEAST_VOLTAGE: 40,
    (16, 2): 1000,
    PHASE: 12,
    WEAK: 20,
    STRENGTH: 1000,
    LOCK: 1,
    VOLTAGE: 52,
    TEMPERATURE: 25,
}


def to_signed(raw: int, bit: int) -> int:
    magnitude = raw & ((1 << bit) - 1)
    return -magnitude if raw >> bit & 1 else magnitude


def from_signed(value: int, bit: int) -> int:
    return -value | 1 << bit if value < 0 else value


def checksum(body: bytes) -> int:
    return ~sum(body) & 0xFF


class FakeServo:
    """Registers, and a motor that follows its goal within speed, acceleration and strength."""

    def __init__(self, number: int, *, goal_switches_on: bool = True) -> None:
        self.goal_switches_on = goal_switches_on
        self.encoder = TURN / 2  # where the axis is [steps]
        self.speed = 0.0  # [steps/s]
        self.pull = 0.0  # what pulls at it: moves it where it has no strength [steps/s]
        self.needs = 0.0  # strength that it takes to withstand the pull, 0 to 1
        self.alarms = 0  # that the back door has set
        self.powered = True
        self.registers = bytearray(256)
        for register, value in AS_DELIVERED.items():
            self.put(register, value)
        self.put(ID, number)
        self.eeprom = bytes(self.registers)
        self.power_up()

    def get(self, register: tuple[int, int]) -> int:
        address, size = register
        return int.from_bytes(self.registers[address : address + size], "little")

    def put(self, register: tuple[int, int], value: int) -> None:
        address, size = register
        self.registers[address : address + size] = value.to_bytes(size, "little")

    def power_up(self) -> None:
        """Sets the registers as they are after the power was off."""
        self.registers[:] = self.eeprom
        self.powered, self.speed, self.alarms = True, 0.0, 0

    def keep(self) -> None:
        """The registers below 40 become those after the power was off."""
        self.eeprom = bytes(self.registers[:40]) + self.eeprom[40:]

    @property
    def shown(self) -> int:
        return (round(self.encoder) - to_signed(self.get(OFFSET), 11)) % TURN

    def stand_at(self, position: int) -> None:
        """Moves the axis to where the servo shows this position."""
        self.encoder = float(position + to_signed(self.get(OFFSET), 11))
        self.speed = 0.0

    def calibrate(self, offset: int, smallest: int, largest: int) -> None:
        self.put(OFFSET, from_signed(offset, 11))
        self.put(SMALLEST, smallest)
        self.put(LARGEST, largest)
        self.keep()

    def write(self, address: int, data: bytes) -> None:
        for at, byte in enumerate(data, address):
            if at >= 5:  # the others are read only
                self.registers[at] = byte
        touched = range(address, address + len(data))
        if GOAL[0] in touched and self.goal_switches_on and TORQUE[0] not in touched:
            self.put(TORQUE, 1)
        if TORQUE[0] in touched:
            if self.get(TORQUE) == 128:
                self.put(OFFSET, from_signed(round(self.encoder) - TURN // 2, 11))
                self.put(TORQUE, 0)
            if self.get(TORQUE) == 0:
                self.alarms &= ~32
        if any(at in EEPROM for at in touched) and self.get(LOCK) == 0:
            self.keep()

    def read(self, address: int, size: int) -> bytes:
        self.put(POSITION, from_signed(self.shown, 15))
        self.put(MOVED, from_signed(round(self.speed), 15))
        self.put(MOVING, int(abs(self.speed) > 0.5))
        self.put(STATUS, self.status)
        return bytes(self.registers[address : address + size])

    @property
    def status(self) -> int:
        volts = self.get(VOLTAGE)
        wrong = not self.get(LEAST_VOLTAGE) <= volts <= self.get(MOST_VOLTAGE)
        hot = self.get(TEMPERATURE) >= self.get(HOTTEST)
        return self.alarms | (1 if wrong else 0) | (4 if hot else 0)

    def pass_time(self, seconds: float) -> None:
        if self.status & 4:
            self.put(TORQUE, 0)
        strength = self.get(STRENGTH) / 1000 if self.powered and self.get(TORQUE) else 0.0
        if self.status & 32:
            strength *= self.get(WEAK) / 100
        if strength == 0 or strength < self.needs:
            self.encoder += self.pull * seconds
            self.speed = 0.0  # of the motor's own motion
            return
        unit = 1 if self.get(PHASE) & 4 else 50
        fastest = self.get(SPEED) * unit or 3000
        change = (self.get(ACCELERATION) * 100 or 1e6) * seconds
        goal = max(self.get(SMALLEST), min(self.get(LARGEST), to_signed(self.get(GOAL), 15)))
        way = goal - (self.encoder - to_signed(self.get(OFFSET), 11)) % TURN
        braking = math.sqrt(2 * (change / seconds) * abs(way)) if seconds else 0.0
        wanted = math.copysign(min(fastest, braking, abs(way) / seconds), way)
        self.speed += max(-change, min(change, wanted - self.speed))
        self.encoder += self.speed * seconds


class FakeChain:
    """Servos on a pseudo-terminal. `port` is its name, which stays when it is plugged in again."""

    def __init__(
        self,
        port: Path,
        servos: int = 6,
        *,
        tick: float | None = None,
        latency: float = 0.0,
        bus_time: bool = False,
        goal_switches_on: bool = True,
    ) -> None:
        self.port = port
        self.servos = {
            number: FakeServo(number, goal_switches_on=goal_switches_on)
            for number in range(1, servos + 1)
        }
        self.tick, self.latency, self.bus_time = tick, latency, bus_time
        self.reads = 0  # of all servos at once
        self.damaged = 0  # answers
        self.goals: list[dict[int, int]] = []  # of each sync write of goals
        self.silent: set[int] = set()
        self.damages = 0.0  # share of the answers
        self.false: dict[int, list[int]] = {}  # positions that undamaged answers show
        self.late: list[int] = []  # after how many readings the answers to the next ones come
        self._held: list[tuple[int, bytes]] = []  # at which reading they come
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

    # the back door
    def cut(self) -> None:
        """The adapter is unplugged."""
        with self._lock:
            if self._master >= 0:
                os.close(self._master)
            self._master = -1
            self.port.unlink(missing_ok=True)

    def plug(self) -> None:
        """The adapter is plugged in."""
        with self._lock:
            self._master, slave = os.openpty()
            tty.setraw(slave)
            self.port.unlink(missing_ok=True)
            self.port.symlink_to(os.ttyname(slave))
            os.close(slave)  # as a line that nobody has opened
        with suppress(OSError):
            os.write(self._waker, b"p")

    def unplug(self, servo: int) -> None:
        """This servo and those behind it lose their power."""
        with self._lock:
            for number in range(servo, len(self.servos) + 1):
                self.servos[number].powered = False

    def plug_in(self, servo: int) -> None:
        """They have it again, and their registers are as after a power-up."""
        with self._lock:
            for number in range(servo, len(self.servos) + 1):
                self.servos[number].power_up()

    def wait_until_closed(self) -> None:
        """Returns when the client has closed the line and all that it sent has been done."""
        self._closed.wait()

    # the line
    def _serve(self) -> None:
        received = bytearray()
        while True:
            with self._lock:
                master = self._master
            watched = [self._wake] if master < 0 else [self._wake, master]
            ready, _, _ = select.select(watched, [], [])
            if self._wake in ready:
                if os.read(self._wake, 1) == b"x":
                    return
                continue
            if not self._serve_once(master, received):
                self._closed.set()
                received.clear()
                time.sleep(0.005)  # until somebody opens the line

    def _serve_once(self, master: int, received: bytearray) -> bool:
        """Answers what has arrived; false if nobody has the line open."""
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

    @staticmethod
    def _requests(received: bytearray) -> list[bytes]:
        """Bodies of the whole packets, which are removed: id, length, instruction, parameters."""
        found = []
        while (begin := received.find(b"\xff\xff")) >= 0:
            del received[:begin]
            if len(received) < 4 or len(received) < received[3] + 4:
                break
            body = bytes(received[2 : received[3] + 4])
            if sum(body) & 0xFF == 0xFF:
                found.append(body[:-1])
                del received[: body[1] + 4]
            else:
                del received[:2]
        return found

    def _answer(self, body: bytes) -> bytes:
        number, _, instruction, *rest = body
        parameters = bytes(rest)
        if self.bus_time:
            time.sleep(BYTE * (len(body) + 3))
        if self.tick is None:
            clock = time.monotonic()
            self._pass_time(clock - self._passed)
            self._passed = clock
        if instruction == 0x82:
            return self._sync_read(parameters[0], parameters[1], parameters[2:])
        if instruction == 0x83:
            self._sync_write(parameters[0], parameters[1], parameters[2:])
            return b""
        found = []
        for each in list(self.servos) if number == EVERYBODY else [number]:
            if not self._hears(each):
                continue
            servo = self.servos[each]
            if instruction == 3:
                servo.write(parameters[0], parameters[1:])
                self.servos = {each.get(ID): each for each in self.servos.values()}
            data = servo.read(*parameters) if instruction == 2 else b""
            if instruction == 1 or number != EVERYBODY:
                found.append(self._packet(each, servo, data))
        return b"".join(found)

    def _hears(self, number: int) -> bool:
        servo = self.servos.get(number)
        return servo is not None and servo.powered and number not in self.silent

    def _sync_write(self, address: int, size: int, data: bytes) -> None:
        each = [data[i : i + size + 1] for i in range(0, len(data), size + 1)]
        for value in each:
            if self._hears(value[0]):
                self.servos[value[0]].write(address, value[1:])
        if address == GOAL[0]:
            self.goals.append({value[0]: int.from_bytes(value[1:3], "little") for value in each})

    def _sync_read(self, address: int, size: int, numbers: bytes) -> bytes:
        self.reads += 1
        if self.tick is not None:
            self._pass_time(self.tick)
        found = []
        for number in numbers:
            if not self._hears(number):
                break  # those behind it wait for it
            data = bytearray(self.servos[number].read(address, size))
            if positions := self.false.get(number):
                at = POSITION[0] - address
                data[at : at + 2] = positions.pop(0).to_bytes(2, "little")
            found.append(self._packet(number, self.servos[number], bytes(data)))
        answers = b"".join(found)
        if self.bus_time:
            time.sleep(BYTE * len(answers))
        if self.late and (after := self.late.pop(0)):
            self._held.append((self.reads + after, answers))
            answers = b""
        due = b"".join(held for at, held in self._held if at <= self.reads)
        self._held = [(at, held) for at, held in self._held if at > self.reads]
        return due + answers

    def _packet(self, number: int, servo: FakeServo, data: bytes) -> bytes:
        body = bytes([number, len(data) + 2, servo.status]) + data
        packet = bytearray(b"\xff\xff" + body + bytes([checksum(body)]))
        if self.damages and self._dice.random() < self.damages:
            self.damaged += 1
            packet[self._dice.randrange(len(packet))] ^= 1 << self._dice.randrange(8)
        return bytes(packet)

    def _pass_time(self, seconds: float) -> None:
        while seconds > 0:
            step = min(seconds, 0.01)
            for servo in self.servos.values():
                servo.pass_time(step)
            seconds -= step
