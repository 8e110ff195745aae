"""Dynamixel servos of the X series on a pseudo-terminal."""

import termios
from pathlib import Path
from typing import ClassVar

from o80_arms.dynamixel import KOCH, XL430, has_crc, packet, unstuffed
from o80_arms.fakes import chain
from o80_arms.fakes.chain import EVERYBODY, Register

# registers: address, size
FIRMWARE, RETURN_DELAY, OFFSET, HOTTEST = (6, 1), (9, 1), (20, 4), (31, 1)
MOST_VOLTAGE, LEAST_VOLTAGE, MOST_PWM, MOST_CURRENT = (32, 2), (34, 2), (36, 2), (38, 2)
LARGEST, SMALLEST, SHUTDOWN = (48, 4), (52, 4), (63, 1)
ANSWERS, FAILURE, WATCHDOG, PWM, CURRENT = (68, 1), (70, 1), (98, 1), (100, 2), (102, 2)
ACCELERATION, SPEED, MOVED = (108, 4), (112, 4), (128, 4)
GOALS = (100, 102, 104, 116)  # registers locked after a stop by the watchdog
RATE, RATES = (8, 1), {termios.B57600: 1, termios.B115200: 2, termios.B1000000: 3}
SPEED_UNIT, ACCELERATION_UNIT = 0.229 * 4096 / 60, 214.577 * 4096 / 3600  # [steps/s, /s^2]
RANGE_ERROR, ACCESS_ERROR, ALERT = 4, 7, 128
RESTART = 0.05  # [s]


class FakeServo(chain.FakeServo):
    """A servo of the X series."""

    MODEL, ID, MODE, TORQUE = (0, 2), (7, 1), (11, 1), (64, 1)
    GOAL, POSITION, VOLTAGE, TEMPERATURE = (116, 4), (132, 4), (144, 2), (146, 1)
    KEPT = 64
    AS_DELIVERED: ClassVar[dict[Register, int]] = {
        FIRMWARE: 50,
        RATE: 1,
        RETURN_DELAY: 250,
        MODE: 3,
        HOTTEST: 70,
        MOST_VOLTAGE: 70,
        LEAST_VOLTAGE: 35,
        MOST_PWM: 885,
        MOST_CURRENT: 1750,
        LARGEST: 4095,
        SHUTDOWN: 52,
        ANSWERS: 2,
        PWM: 885,
        CURRENT: 1750,
        VOLTAGE: 50,
        TEMPERATURE: 25,
    }

    def __init__(self, number: int, model: int) -> None:
        self.error = 0  # error of the last instruction
        self.starts = 0.0  # remaining time of a restart [s]
        super().__init__(number)
        self.put(self.MODEL, model)
        if model == XL430:
            self.put(MOST_VOLTAGE, 140)
            self.put(LEAST_VOLTAGE, 60)
            self.put(self.VOLTAGE, 120)
        self.eeprom = bytes(self.registers)

    @property
    def strength(self) -> float:
        grips = self.get(self.MODE) == 5
        return self.get(CURRENT) / 1750 if grips else self.get(PWM) / 885

    def signed(self, register: Register) -> int:
        address, size = register
        return int.from_bytes(self.registers[address : address + size], "little", signed=True)

    @property
    def shown(self) -> int:
        return round(self.encoder) + self.signed(OFFSET)

    def stand_at(self, position: int) -> None:
        self.encoder = float(position - self.signed(OFFSET))
        self.speed = 0.0

    def calibrate(self, offset: int, smallest: int, largest: int) -> None:
        self.put(OFFSET, offset)
        self.put(SMALLEST, smallest)
        self.put(LARGEST, largest)
        self.keep()

    def overload(self) -> None:
        self.alarms |= 32

    def write(self, address: int, data: bytes) -> None:
        """Refuses persistent registers while the torque is on, and goals after a watchdog stop."""
        self.error = 0
        if address < self.KEPT and self.torque:
            self.error = ACCESS_ERROR
        elif address in GOALS and self.get(WATCHDOG) == 255:
            self.error = RANGE_ERROR
        if self.error:
            return
        had_torque = self.torque
        self.registers[address : address + len(data)] = data
        if address < self.KEPT:
            self.keep()
        if self.torque and not had_torque:
            self.unheard = 0.0
            if self.get(FAILURE) & self.get(SHUTDOWN):
                self.put(self.TORQUE, 0)

    def read(self, address: int, size: int) -> bytes:
        self.put(self.POSITION, self.shown)
        self.put(MOVED, round(self.speed / SPEED_UNIT))
        self.put(FAILURE, self.failures)
        return bytes(self.registers[address : address + size])

    @property
    def failures(self) -> int:
        """Bits of the failures, kept until a restart."""
        volts = self.get(self.VOLTAGE)
        if not self.get(LEAST_VOLTAGE) <= volts <= self.get(MOST_VOLTAGE):
            self.alarms |= 1
        if self.get(self.TEMPERATURE) >= self.get(HOTTEST):
            self.alarms |= 4
        return self.alarms

    @property
    def status(self) -> int:
        return self.error | (ALERT if self.failures else 0)

    def restart(self) -> None:
        self.powered, self.starts = False, RESTART
        self.put(self.TORQUE, 0)

    def pass_time(self, seconds: float) -> None:
        if self.starts > 0:
            self.starts -= seconds
            if self.starts <= 0:
                self.power_up()
        if self.failures & self.get(SHUTDOWN):
            self.put(self.TORQUE, 0)
        limit = self.get(WATCHDOG)
        if self.torque and 0 < limit < 255 and self.unheard > 0.02 * limit:
            self.put(WATCHDOG, 255)
        if self.get(WATCHDOG) == 255:
            self.put(self.GOAL, self.shown)  # stops the motor
        strength = self.strength if self.powered and self.torque else 0.0
        way = self.signed(self.GOAL) - (self.encoder + self.signed(OFFSET))
        fastest = self.get(SPEED) * SPEED_UNIT or 5000
        self.move(
            seconds, strength, way, fastest, self.get(ACCELERATION) * ACCELERATION_UNIT or 1e6
        )


class FakeChain(chain.FakeChain[FakeServo]):
    """Servos of a Koch arm."""

    def __init__(
        self,
        port: Path,
        models: tuple[int, ...] = KOCH,
        *,
        tick: float | None = None,
        latency: float = 0.0,
        bus_time: bool = False,
    ) -> None:
        servos = [FakeServo(number, model) for number, model in enumerate(models, 1)]
        for servo in servos:
            servo.put(RATE, 3)  # rate set by `o80 arms number`
            servo.keep()
        super().__init__(port, servos, tick=tick, latency=latency, bus_time=bus_time)

    def _hears(self, number: int) -> bool:
        """Whether a servo receives a request: the line must have the servo's rate."""
        rate = RATES.get(termios.tcgetattr(self._master)[5])
        return super()._hears(number) and self.servos[number].get(RATE) == rate

    def _requests(self, received: bytearray) -> list[bytes]:
        found = []
        while (begin := received.find(b"\xff\xff\xfd")) >= 0:
            del received[:begin]
            size = int.from_bytes(received[5:7], "little") + 7
            if len(received) < 10 or len(received) < size:
                break
            whole = bytes(received[:size])
            if has_crc(whole):
                found.append(whole[4:5] + unstuffed(whole[7:-2]))
                del received[:size]
            else:
                del received[:3]
        return found

    def _serve_request(self, number: int, instruction: int, parameters: bytes) -> bytes:
        for servo in self.servos.values():
            servo.unheard = 0.0
            servo.error = 0
        two = [int.from_bytes(parameters[i : i + 2], "little") for i in (0, 2)]
        match instruction:
            case 0x82:
                return self._read_all([(each, two[0], two[1]) for each in parameters[4:]])
            case 0x92:
                each_5 = [parameters[i : i + 5] for i in range(0, len(parameters), 5)]
                return self._read_all([(each[0], each[1], each[3]) for each in each_5])
            case 0x83:
                self._write_all(two[0], two[1], parameters[4:])
                return b""
        found = []
        for each in list(self.servos) if number == EVERYBODY else [number]:
            if not self._hears(each):
                continue
            servo = self.servos[each]
            answers, data = servo.get(ANSWERS), b""
            if instruction == 1:
                data = servo.read(0, 2) + servo.read(6, 1)
            elif instruction == 2:
                data = servo.read(two[0], two[1])
            elif instruction == 3:
                servo.write(two[0], parameters[2:])
                self.servos = {each.get(each.ID): each for each in self.servos.values()}
            elif instruction == 8:
                servo.restart()
            wanted = answers == 2 or instruction in (1, 2)
            if wanted and (instruction == 1 or number != EVERYBODY):
                found.append(self._answer_of(each, servo, data))
        return b"".join(found)

    def _packet(self, number: int, status: int, data: bytes) -> bytes:
        return packet(number, 0x55, bytes([status]) + data)
