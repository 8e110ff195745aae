"""Serial line of servos, for set-up: sends one request at a time and waits for the answer."""

import errno
import fcntl
import os
import select
import termios
import time
import tty
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import o80
from o80.base.descriptors import above_standard
from o80_arms import dynamixel

WAIT = 0.05  # timeout of an answer [s]
TRIES = 3
PATIENCE = 60  # attempts where a failure would lose the user's work
EVERYBODY = 254
SERVOS = range(1, 7)  # of an arm


class BusError(o80.Error):
    """The line cannot be used, or a servo does not obey."""


@dataclass(frozen=True)
class Register:
    """Address and size of a servo's number; `sign` is the bit of the sign, if any."""

    address: int
    size: int
    sign: int | None = None


TURN = 4096


class Bus:
    """Requests to Feetech servos on a port, which this process opens exclusively."""

    MODELS: ClassVar = {777: "STS3215"}
    FIRMWARE, MODEL, ID = Register(0, 2), Register(3, 2), Register(5, 1)
    SMALLEST, LARGEST, LEAST_VOLTAGE = Register(9, 2), Register(11, 2), Register(15, 1)
    RETURN_DELAY, PHASE, GAIN = Register(7, 1), Register(18, 1), Register(21, 1)
    OFFSET, MODE, TORQUE = Register(31, 2, 11), Register(33, 1), Register(40, 1)
    GOAL, LOCK, POSITION = Register(42, 2, 15), Register(55, 1), Register(56, 2, 15)
    VOLTAGE, TEMPERATURE = Register(62, 1), Register(63, 1)
    modes = (0,) * 6  # of the servos of an arm
    tries = TRIES  # attempts of a read
    PING = 0  # bytes of the answer to a ping
    OFFSET_SIGN = -1  # shown position = encoder - offset

    @above_standard()
    def __init__(self, port: Path, wait: float | None = None) -> None:
        self.port, self.wait = port, WAIT if wait is None else wait
        owner = owner_of(port)
        if owner:
            raise BusError(f"{owner} has {port} open: stop it first")
        try:
            self._line = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except PermissionError:
            raise BusError(
                f"no permission for {port}: run `sudo usermod -aG dialout $USER`, then log in again"
            ) from None
        except OSError as error:
            raise BusError(f"cannot open {port} ({os.strerror(error.errno or 0)})") from None
        try:
            fcntl.flock(self._line, fcntl.LOCK_EX | fcntl.LOCK_NB)
            tty.setraw(self._line)
            self._set_rate(termios.B1000000)
        except (OSError, termios.error) as error:
            os.close(self._line)
            busy = isinstance(error, OSError) and error.errno in (errno.EAGAIN, errno.EACCES)
            why = "another process has it open" if busy else "it is not a serial line for 1 Mbaud"
            raise BusError(f"cannot use {port}: {why}") from None
        self._question = 0

    def _set_rate(self, rate: int) -> None:
        attributes = termios.tcgetattr(self._line)
        attributes[4] = attributes[5] = rate
        termios.tcsetattr(self._line, termios.TCSANOW, attributes)

    def close(self) -> None:
        os.close(self._line)

    def scan(self, servos: Iterable[int] = range(1, 13)) -> list[int]:
        """Numbers of the servos that answer a ping."""
        return [servo for servo in servos if self._ask(servo, 1, b"", self.PING) is not None]

    def read(self, servo: int, register: Register) -> int:
        """Reads a register. Raises BusError if the servo does not answer."""
        for _ in range(self.tries):
            # request sizes differ in turn, so that a late answer to another request is detected
            self._question = (self._question + 1) % 8
            size = register.size + self._question
            if answer := self._ask(servo, 2, self._numbers(register.address, size), size):
                return self._value(register, answer[: register.size])
        raise BusError(f"servo {servo} at {self.port} does not answer: check its plug")

    def write(self, servo: int, register: Register, value: int) -> None:
        """Writes a register and reads it back. Raises BusError if the values differ."""
        for _ in range(TRIES):
            self.send(servo, register, value)
            if self.read(servo, register) == value:
                return
        raise BusError(
            f"servo {servo} at {self.port} does not keep {value} in its register {register.address}"
        )

    def send(self, servo: int, register: Register, value: int) -> None:
        """Writes a register without a check."""
        self._ask(servo, 3, self._numbers(register.address) + self._bytes(register, value), 0)

    @contextmanager
    def unlocked(self, servo: int) -> Iterator[None]:
        """Switches the torque off and makes writes inside the context persistent."""
        self.write(servo, self.TORQUE, 0)
        self.write(servo, self.LOCK, 0)
        yield
        self.write(servo, self.LOCK, 1)

    def relax(self, servo: int) -> None:
        self.write(servo, self.TORQUE, 0)

    def found(self) -> list[int] | None:
        """Numbers of the servos that answer a broadcast ping; None if their answers collide."""
        received, found = self.answers(packet(EVERYBODY, 1, b"")), []
        while received:
            head, received = received[:6], received[6:]
            if len(head) < 6 or head[:2] != b"\xff\xff" or sum(head[2:]) & 0xFF != 0xFF:
                return None
            found.append(head[2])
        return found

    def number(self, servo: int, number: int) -> None:
        """Writes a servo's number persistently."""
        self.write(servo, self.TORQUE, 0)
        self.write(servo, self.LOCK, 0)
        self.send(servo, self.ID, number)  # from here on the servo answers to the new number
        self.write(number, self.ID, number)
        self.write(number, self.LOCK, 1)

    def read_all(self, servos: list[int], size: int) -> tuple[bytes, int]:
        """Returns a request for `size` bytes of each servo from POSITION, and the answer's size."""
        request = packet(EVERYBODY, 0x82, bytes([self.POSITION.address, size, *servos]))
        return request, len(servos) * (size + 6)

    def answered(self, received: bytes, servo: int) -> bool:
        """Whether `received` holds an answer of this servo."""
        return received.find(bytes([0xFF, 0xFF, servo])) >= 0

    @staticmethod
    def dotted(firmware: int) -> str:
        return f"{firmware & 255}.{firmware >> 8}"

    # the protocol
    @staticmethod
    def _numbers(*numbers: int) -> bytes:
        """Encodes addresses and sizes of a request."""
        return bytes(numbers)

    @staticmethod
    def _value(register: Register, data: bytes) -> int:
        raw, sign = int.from_bytes(data, "little"), register.sign
        return raw if sign is None else (-1 if raw >> sign & 1 else 1) * (raw % (1 << sign))

    @staticmethod
    def _bytes(register: Register, value: int) -> bytes:
        raw = value if value >= 0 else -value | 1 << (register.sign or 0)
        return raw.to_bytes(register.size, "little")

    @staticmethod
    def _packet(servo: int, instruction: int, parameters: bytes) -> bytes:
        return packet(servo, instruction, parameters)

    @staticmethod
    def _data(received: bytes, servo: int, size: int) -> bytes | None:
        """Returns the data of the servo's first answer of this size."""
        begin = received.find(bytes([0xFF, 0xFF, servo, size + 2]))
        found = received[begin + 2 : begin + size + 6]
        whole = begin >= 0 and len(found) == size + 4 and sum(found) & 0xFF == 0xFF
        return found[3:-1] if whole else None

    def answers(self, request: bytes, size: int | None = None, wait: float | None = None) -> bytes:
        """Returns all bytes received within the timeout; with a size: that many bytes, or none."""
        self._send(request)
        received = self._received(lambda received: len(received) == size, wait)
        return received if size is None or len(received) == size else b""

    def _ask(self, servo: int, instruction: int, parameters: bytes, size: int) -> bytes | None:
        """Sends a request; returns the data of an answer of this size, or None."""
        self._send(self._packet(servo, instruction, parameters))
        received = self._received(lambda received: self._data(received, servo, size) is not None)
        return self._data(received, servo, size)

    def _send(self, request: bytes) -> None:
        termios.tcflush(self._line, termios.TCIFLUSH)
        try:
            os.write(self._line, request)
        except OSError:
            raise BusError(f"the adapter {self.port} is unplugged") from None

    def _received(self, is_enough: Callable[[bytes], bool], wait: float | None = None) -> bytes:
        received, end = b"", time.monotonic() + (self.wait if wait is None else wait)
        while not is_enough(received):
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._line], [], [], left)[0]:
                break
            with suppress(BlockingIOError):
                part = os.read(self._line, 4096)
                if not part:
                    raise BusError(f"the adapter {self.port} is unplugged")
                received += part
        return received


def packet(servo: int, instruction: int, parameters: bytes) -> bytes:
    body = bytes([servo, len(parameters) + 2, instruction]) + parameters
    return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


class DynamixelBus(Bus):
    """Requests to Dynamixel servos."""

    MODELS: ClassVar = {1060: "XL430-W250", 1190: "XL330-M077", 1200: "XL330-M288"}
    RATES = (termios.B1000000, termios.B57600, termios.B115200)  # ours, as delivered, another
    ALL = 0.8  # servos answer a broadcast ping in turn, 3 ms for each number [s]
    RATE, OUR_RATE = Register(8, 1), 3
    FIRMWARE, MODEL, ID = Register(6, 1), Register(0, 2), Register(7, 1)
    SMALLEST, LARGEST, LEAST_VOLTAGE = Register(52, 4), Register(48, 4), Register(34, 2)
    RETURN_DELAY, PHASE, GAIN = Register(9, 1), Register(10, 1), Register(84, 2)
    OFFSET, MODE, TORQUE = Register(20, 4, 31), Register(11, 1), Register(64, 1)
    GOAL, POSITION, FAILURE = Register(116, 4, 31), Register(132, 4, 31), Register(70, 1)
    VOLTAGE, TEMPERATURE, WATCHDOG = Register(144, 2), Register(146, 1), Register(98, 1)
    modes = (4, 4, 4, 4, 4, 5)
    PING = 3
    OFFSET_SIGN = 1  # shown position = encoder + offset

    @contextmanager
    def unlocked(self, servo: int) -> Iterator[None]:
        self.write(servo, self.TORQUE, 0)
        yield

    def relax(self, servo: int) -> None:
        """Switches the torque off, and restarts a servo after a failure."""
        self.write(servo, self.TORQUE, 0)
        self.write(servo, self.WATCHDOG, 0)
        if self.read(servo, self.FAILURE):
            self._ask(servo, 8, b"", 0)

    def found(self) -> list[int] | None:
        """Numbers found at the first rate with an answer; the line keeps that rate."""
        for rate in self.RATES:
            self._set_rate(rate)
            received, found = self.answers(dynamixel.packet(EVERYBODY, 1, b""), wait=self.ALL), []
            while whole := dynamixel.unpacked(received):
                found.append(whole[0])
                received = whole[2]
            if received:
                return None
            if found:
                return found
        return []

    def number(self, servo: int, number: int) -> None:
        """Writes a servo's number and o80's rate persistently."""
        self.write(servo, self.TORQUE, 0)
        self.send(servo, self.ID, number)
        self.write(number, self.ID, number)
        self.send(number, self.RATE, self.OUR_RATE)
        self._set_rate(self.RATES[0])
        self.write(number, self.RATE, self.OUR_RATE)

    def read_all(self, servos: list[int], size: int) -> tuple[bytes, int]:
        parameters = self._numbers(self.POSITION.address, size) + bytes(servos)
        return dynamixel.packet(EVERYBODY, 0x82, parameters), len(servos) * (size + 11)

    def answered(self, received: bytes, servo: int) -> bool:
        while found := dynamixel.unpacked(received):
            number, _, received = found
            if number == servo:
                return True
        return False

    @staticmethod
    def dotted(firmware: int) -> str:
        return str(firmware)

    @staticmethod
    def _numbers(*numbers: int) -> bytes:
        return b"".join(number.to_bytes(2, "little") for number in numbers)

    @staticmethod
    def _value(register: Register, data: bytes) -> int:
        return int.from_bytes(data, "little", signed=register.sign is not None)

    @staticmethod
    def _bytes(register: Register, value: int) -> bytes:
        return value.to_bytes(register.size, "little", signed=register.sign is not None)

    @staticmethod
    def _packet(servo: int, instruction: int, parameters: bytes) -> bytes:
        return dynamixel.packet(servo, instruction, parameters)

    @staticmethod
    def _data(received: bytes, servo: int, size: int) -> bytes | None:
        while found := dynamixel.unpacked(received):
            number, body, received = found
            if number == servo and body[0] == 0x55 and len(body) == size + 2:
                return body[2:]
        return None


def bus_at(port: Path) -> Bus:
    """Opens a port with the protocol that a servo answers, or with Feetech's if none does."""
    for protocol in (Bus, DynamixelBus):
        with ExitStack() as opened:
            bus = protocol(port)
            opened.callback(bus.close)
            if any(bus.scan([servo]) for servo in SERVOS):
                opened.pop_all()
                return bus
    return Bus(port)


def ports() -> list[Path]:
    """Lists the serial adapters that may have servos."""
    return sorted([*Path("/dev").glob("ttyACM*"), *Path("/dev").glob("ttyUSB*")])


def owner_of(port: Path) -> str:
    """Names the process that has a port open, "'lerobot-teleop' (pid 4711)"; empty: none."""
    file = str(port.resolve())
    for process in Path("/proc").glob("[0-9]*"):
        if process.name == str(os.getpid()):
            continue
        with suppress(OSError):
            if any(os.readlink(each) == file for each in (process / "fd").iterdir()):
                name = (process / "comm").read_text().strip()
                return f"'{name}' (pid {process.name})"
    return ""
