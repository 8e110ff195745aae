"""The fake Dynamixel servos, driven by a client that others wrote: the maker's own."""

from collections.abc import Iterator

import dynamixel_sdk as sdk
import pytest
from fake_arm import FakeArm

GOAL, POSITION, TORQUE, MODE, WATCHDOG = 116, 132, 64, 11, 98
pytestmark = pytest.mark.parametrize("arm", ["koch"], indirect=True)


class Client:
    """The maker's client, with one line for each thing that a test does."""

    def __init__(self, port: str) -> None:
        self.port = sdk.PortHandler(port)
        assert self.port.openPort()
        assert self.port.setBaudRate(1_000_000)
        self.packets = sdk.PacketHandler(2.0)

    def read(self, servo: int, address: int) -> tuple[int, int]:
        value, result, error = self.packets.read4ByteTxRx(self.port, servo, address)
        assert result == sdk.COMM_SUCCESS
        return int(value), int(error)

    def write(self, servo: int, address: int, value: int) -> int:
        """Error byte of the answer."""
        result, error = self.packets.write1ByteTxRx(self.port, servo, address, value)
        assert result == sdk.COMM_SUCCESS
        return int(error)

    def positions(self) -> list[int]:
        group = sdk.GroupSyncRead(self.port, self.packets, POSITION, 4)
        for servo in range(1, 7):
            assert group.addParam(servo)
        assert group.txRxPacket() == sdk.COMM_SUCCESS
        return [int(group.getData(servo, POSITION, 4)) for servo in range(1, 7)]

    def send_goals(self, goals: list[int]) -> None:
        group = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 4)
        for servo, goal in enumerate(goals, 1):
            assert group.addParam(servo, list(goal.to_bytes(4, "little")))
        assert group.txPacket() == sdk.COMM_SUCCESS


@pytest.fixture
def client(arm: FakeArm) -> Iterator[Client]:
    made = Client(str(arm.line.port))
    # a busy machine may answer late
    made.port.isPacketTimeout = lambda: made.port.getTimeSinceStart() > 60_000
    yield made
    made.port.closePort()


def test_it_answers_pings_and_reads(client: Client) -> None:
    model, result, error = client.packets.ping(client.port, 3)
    assert (model, result, error) == (1200, sdk.COMM_SUCCESS, 0)
    assert client.read(2, 20) == (30, 0)
    group = sdk.GroupBulkRead(client.port, client.packets)
    for servo, (address, size) in enumerate([(POSITION, 4), (144, 2)], 1):
        assert group.addParam(servo, address, size)
    assert group.txRxPacket() == sdk.COMM_SUCCESS
    assert (group.getData(1, POSITION, 4), group.getData(2, 144, 2)) == (2100, 120)


def test_what_looks_like_a_header_arrives(client: Client, arm: FakeArm) -> None:
    client.packets.write4ByteTxRx(client.port, 1, GOAL, 0xFDFFFF)
    assert client.read(1, GOAL) == (0xFDFFFF, 0)
    assert client.read(1, GOAL - 1)[0] == 0xFDFFFF00


def test_its_servos_go_to_their_goals_and_lock_what_lasts(client: Client) -> None:
    for servo in range(1, 7):
        assert client.write(servo, TORQUE, 1) == 0
    assert client.write(1, MODE, 3) == 7, "with torque"
    goals = [1000, 1100, 1200, 1300, 1400, 100]
    client.send_goals(goals)
    for _ in range(300):
        reached = client.positions()
    assert reached == goals


def test_an_overload_is_told_until_a_restart(client: Client, arm: FakeArm) -> None:
    arm.line.servos[2].overload()
    assert client.read(2, 70)[1] == 128
    assert client.read(2, 70)[0] & 0xFF == 32
    assert client.packets.reboot(client.port, 2)[0] == sdk.COMM_SUCCESS
    arm.line.pass_time(0.1)
    assert client.read(2, 70)[0] & 0xFF == client.read(2, 70)[1] == 0


def test_a_servo_that_hears_nothing_stops_until_that_is_cleared(
    client: Client, arm: FakeArm
) -> None:
    client.write(1, TORQUE, 1)
    client.write(1, WATCHDOG, 5)
    client.send_goals([3000] + [2100] * 5)
    arm.line.pass_time(0.3)
    there = client.positions()[0]
    assert there < 3000
    _, error = client.packets.write4ByteTxRx(client.port, 1, GOAL, 3000)
    assert error == 4
    client.write(1, WATCHDOG, 0)
    assert client.packets.write4ByteTxRx(client.port, 1, GOAL, there)[1] == 0
