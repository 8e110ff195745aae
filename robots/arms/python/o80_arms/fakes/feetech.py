"""Feetech STS3215 servos on a pseudo-terminal."""

from pathlib import Path
from typing import ClassVar

from o80_arms.fakes import chain
from o80_arms.fakes.chain import EVERYBODY, TURN, Register

# registers: address, size
FIRMWARE, SMALLEST, LARGEST = (0, 2), (9, 2), (11, 2)
HOTTEST, MOST_VOLTAGE, LEAST_VOLTAGE, PHASE = (13, 1), (14, 1), (15, 1), (18, 1)
OFFSET, WEAK, ACCELERATION, SPEED, STRENGTH = (31, 2), (34, 1), (41, 1), (46, 2), (48, 2)
LOCK, MOVED, STATUS, MOVING = (55, 1), (58, 2), (65, 1), (66, 1)
EEPROM = range(5, 40)


def to_signed(raw: int, bit: int) -> int:
    magnitude = raw & ((1 << bit) - 1)
    return -magnitude if raw >> bit & 1 else magnitude


def from_signed(value: int, bit: int) -> int:
    return -value | 1 << bit if value < 0 else value


def checksum(body: bytes) -> int:
    return ~sum(body) & 0xFF


class FakeServo(chain.FakeServo):
    """An STS3215."""

    MODEL, ID, MODE, TORQUE = (3, 2), (5, 1), (33, 1), (40, 1)
    GOAL, POSITION, VOLTAGE, TEMPERATURE = (42, 2), (56, 2), (62, 1), (63, 1)
    KEPT = 40
    AS_DELIVERED: ClassVar[dict[Register, int]] = {
        FIRMWARE: 0x0903,
        MODEL: 777,
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

    goal_switches_on = True

    @property
    def strength(self) -> float:
        return self.get(STRENGTH) / 1000

    @property
    def shown(self) -> int:
        return (round(self.encoder) - to_signed(self.get(OFFSET), 11)) % TURN

    def stand_at(self, position: int) -> None:
        self.encoder = float(position + to_signed(self.get(OFFSET), 11))
        self.speed = 0.0

    def calibrate(self, offset: int, smallest: int, largest: int) -> None:
        self.put(OFFSET, from_signed(offset, 11))
        self.put(SMALLEST, smallest)
        self.put(LARGEST, largest)
        self.keep()

    def overload(self) -> None:
        self.alarms |= 32

    def write(self, address: int, data: bytes) -> None:
        for at, byte in enumerate(data, address):
            if at >= 5:  # the others are read only
                self.registers[at] = byte
        touched = range(address, address + len(data))
        if self.GOAL[0] in touched and self.goal_switches_on and self.TORQUE[0] not in touched:
            self.put(self.TORQUE, 1)
        if self.TORQUE[0] in touched:
            if self.torque == 128:
                self.put(OFFSET, from_signed(round(self.encoder) - TURN // 2, 11))
                self.put(self.TORQUE, 0)
            if self.torque == 0:
                self.alarms &= ~32
        if any(at in EEPROM for at in touched) and self.get(LOCK) == 0:
            self.keep()

    def read(self, address: int, size: int) -> bytes:
        self.put(self.POSITION, from_signed(self.shown, 15))
        self.put(MOVED, from_signed(round(self.speed), 15))
        self.put(MOVING, int(abs(self.speed) > 0.5))
        self.put(STATUS, self.status)
        return bytes(self.registers[address : address + size])

    @property
    def status(self) -> int:
        volts = self.get(self.VOLTAGE)
        wrong = not self.get(LEAST_VOLTAGE) <= volts <= self.get(MOST_VOLTAGE)
        hot = self.get(self.TEMPERATURE) >= self.get(HOTTEST)
        return self.alarms | (1 if wrong else 0) | (4 if hot else 0)

    def pass_time(self, seconds: float) -> None:
        if self.status & 4:
            self.put(self.TORQUE, 0)
        strength = self.strength if self.powered and self.torque else 0.0
        if self.status & 32:
            strength *= self.get(WEAK) / 100
        unit = 1 if self.get(PHASE) & 4 else 50
        goal = to_signed(self.get(self.GOAL), 15)
        goal = max(self.get(SMALLEST), min(self.get(LARGEST), goal))
        way = goal - (self.encoder - to_signed(self.get(OFFSET), 11)) % TURN
        fastest = self.get(SPEED) * unit or 3000
        self.move(seconds, strength, way, fastest, self.get(ACCELERATION) * 100 or 1e6)


class FakeChain(chain.FakeChain[FakeServo]):
    """Servos of an SO-101."""

    def __init__(
        self,
        port: Path,
        *,
        tick: float | None = None,
        latency: float = 0.0,
        bus_time: bool = False,
    ) -> None:
        servos = [FakeServo(number) for number in range(1, 7)]
        super().__init__(port, servos, tick=tick, latency=latency, bus_time=bus_time)

    def _requests(self, received: bytearray) -> list[bytes]:
        found = []
        while (begin := received.find(b"\xff\xff")) >= 0:
            del received[:begin]
            if len(received) < 4 or len(received) < received[3] + 4:
                break
            body = bytes(received[2 : received[3] + 4])
            if sum(body) & 0xFF == 0xFF:
                found.append(body[:1] + body[2:-1])
                del received[: body[1] + 4]
            else:
                del received[:2]
        return found

    def _serve_request(self, number: int, instruction: int, parameters: bytes) -> bytes:
        if instruction == 0x82:
            return self._read_all([(each, *parameters[:2]) for each in parameters[2:]])
        if instruction == 0x83:
            self._write_all(parameters[0], parameters[1], parameters[2:])
            return b""
        found = []
        for each in list(self.servos) if number == EVERYBODY else [number]:
            if not self._hears(each):
                continue
            servo = self.servos[each]
            if instruction == 3:
                servo.write(parameters[0], parameters[1:])
                self.servos = {each.get(each.ID): each for each in self.servos.values()}
            data = servo.read(*parameters) if instruction == 2 else b""
            if instruction == 1 or number != EVERYBODY:
                found.append(self._answer_of(each, servo, data))
        return b"".join(found)

    def _packet(self, number: int, status: int, data: bytes) -> bytes:
        body = bytes([number, len(data) + 2, status]) + data
        return b"\xff\xff" + body + bytes([checksum(body)])
