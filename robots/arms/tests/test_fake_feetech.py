"""The fake servos, driven by a client that others wrote: the maker's own."""

from collections.abc import Iterator

import pytest
import scservo_sdk as sdk
from fake_arm import FakeArm

PROTOCOL = 0  # numbers little-endian
GOAL, POSITION, TORQUE, LOCK, OFFSET = 42, 56, 40, 55, 31


class Client:
    """The maker's client, with one line for each thing that a test does."""

    def __init__(self, port: str) -> None:
        self.port = sdk.PortHandler(port)
        assert self.port.openPort()
        assert self.port.setBaudRate(1_000_000)
        self.packets = sdk.PacketHandler(PROTOCOL)

    def read(self, servo: int, address: int) -> int:
        value, result, _ = self.packets.read2ByteTxRx(self.port, servo, address)
        assert result == sdk.COMM_SUCCESS
        return int(value)

    def write(self, servo: int, address: int, value: int) -> None:
        result, _ = self.packets.write1ByteTxRx(self.port, servo, address, value)
        assert result == sdk.COMM_SUCCESS

    def positions(self) -> list[int]:
        group = sdk.GroupSyncRead(self.port, self.packets, POSITION, 2)
        for servo in range(1, 7):
            assert group.addParam(servo)
        assert group.txRxPacket() == sdk.COMM_SUCCESS
        return [int(group.getData(servo, POSITION, 2)) for servo in range(1, 7)]

    def send_goals(self, goals: list[int]) -> None:
        group = sdk.GroupSyncWrite(self.port, self.packets, GOAL, 2)
        for servo, goal in enumerate(goals, 1):
            assert group.addParam(servo, [goal & 0xFF, goal >> 8])
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
    assert (model, result, error) == (777, sdk.COMM_SUCCESS, 0)
    assert client.read(2, OFFSET) == 30
    assert client.positions() == [2100] * 6


def test_its_servos_go_to_their_goals_and_no_farther_than_they_may(
    client: Client, arm: FakeArm
) -> None:
    goals = [1000, 1100, 1200, 1300, 1400, 100]
    client.send_goals(goals)
    for _ in range(300):
        reached = client.positions()
    assert reached == [*goals[:5], 2000]


def test_what_is_written_lasts_only_if_it_is_unlocked(client: Client, arm: FakeArm) -> None:
    for locked in (1, 0):
        client.write(1, LOCK, locked)
        client.packets.write2ByteTxRx(client.port, 1, OFFSET, 77)
        assert client.read(1, OFFSET) == 77
        arm.line.unplug(1)
        arm.line.plug_in(1)
        assert client.read(1, OFFSET) == (0x080C if locked else 77)


def test_128_makes_the_present_position_the_middle(client: Client, arm: FakeArm) -> None:
    client.write(4, TORQUE, 128)
    assert client.positions()[3] == 2048
    assert client.read(4, TORQUE) & 0xFF == 0
