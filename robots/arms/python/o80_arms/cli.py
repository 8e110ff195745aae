"""``o80 arms``: lists, calibrates and checks arms, and numbers their servos."""

import select
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Literal

import typer

import o80
from o80_arms import calibration
from o80_arms.bus import PATIENCE, SERVOS, TURN, Bus, BusError, DynamixelBus, bus_at, ports
from o80_arms.calibration import JOINTS, LARGEST_OFFSET, Calibration
from o80_arms.dynamixel import KOCH, KOCH_LEADER

STS3215 = 777
ARMS: dict[str, tuple[type[Bus], tuple[int, ...]]] = {
    "so101": (Bus, (STS3215,) * 6),
    "so101_leader": (Bus, (STS3215,) * 6),
    "koch": (DynamixelBus, KOCH),
    "koch_leader": (DynamixelBus, KOCH_LEADER),
}
app = typer.Typer(help="List arms of bus servos, calibrate them, number their servos.")
Port = Annotated[Path | None, typer.Option(help="Port of the adapter (default: the only one).")]


@contextmanager
def opened(port: Path | None, kind: Callable[[Path], Bus] = bus_at) -> Iterator[Bus]:
    """Opens the bus of a port, or of the only port."""
    found = [port] if port else ports()
    if len(found) != 1:
        names = ", ".join(map(str, found)) or "none"
        raise BusError(f"choose an adapter with --port; there are: {names}")
    bus = kind(found[0])
    try:
        yield bus
    finally:
        bus.close()


@app.callback(invoke_without_command=True)
def arms(
    context: typer.Context,
    port: Annotated[list[Path] | None, typer.Option(help="Look at this port only.")] = None,
) -> None:
    """Lists the arms of all ports."""
    if context.invoked_subcommand is not None:
        if port:
            word = context.invoked_subcommand
            raise o80.InvalidArgument(f"--port goes after {word}: `o80 arms {word} --port ...`")
        return
    found = port or ports()
    if not found:
        print("No serial adapter was found: check its USB cable and its power.")
    for each in found:
        print(f"{each}: {told_of(each)}")


def told_of(port: Path) -> str:
    """Describes the servos of a port, or the error."""
    try:
        with opened(port) as bus:
            servos = bus.scan()
            if not servos:
                return "no servo answers: is the power supply on?"
            told = [f"servos {', '.join(map(str, servos))}"]
            models = {bus.read(servo, bus.MODEL) for servo in servos}
            told.append(", ".join(bus.MODELS.get(each, f"model {each}") for each in sorted(models)))
            volts = [bus.read(servo, bus.VOLTAGE) / 10 for servo in servos]
            told.append(f"{min(volts)} V")
            on = sum(bus.read(servo, bus.TORQUE) == 1 for servo in servos)
            told.append(f"torque on in {on} of {len(servos)}" if on else "torque off")
            if servos == list(SERVOS):
                told.append(calibration_of(bus))
            return ", ".join(told)
    except BusError as error:
        return str(error)


def calibration_of(bus: Bus) -> str:
    """Names the LeRobot file with the same calibration as the servos."""
    held = held_by(bus)
    for file in calibration.files(bus):
        with suppress(calibration.CalibrationError):
            if calibration.read(file) == held:
                return "; ".join([f"calibration {file.stem}", *doubts(bus, held)])
    return "no file has its calibration: `o80 arms calibrate --take NAME`"


def held_by(bus: Bus) -> dict[str, Calibration]:
    pairs = zip(JOINTS, SERVOS, strict=True)
    return {joint: Calibration.of_servo(bus, servo) for joint, servo in pairs}


@app.command()
def relax(port: Port = None) -> None:
    """Switch the torque of all servos off. The arm sinks: hold it."""
    with opened(port) as bus:
        servos = bus.scan()
        for servo in servos:
            bus.relax(servo)
    print(f"{len(servos)} servos have no torque")


@app.command()
def calibrate(
    port: Port = None,
    name: Annotated[
        str | None, typer.Option(help="Move the joints by hand; name of the new file.")
    ] = None,
    take: Annotated[
        str | None, typer.Option(help="Make a file of this name from the values in the servos.")
    ] = None,
    write: Annotated[
        str | None, typer.Option(help="Put the file of this name into the servos.")
    ] = None,
    leader: Annotated[bool, typer.Option("--leader", help="The arm is moved by hand.")] = False,
) -> None:
    """Calibrate an arm, or copy a calibration between its servos and LeRobot's file.

    The torque of written servos is switched off: the arm sinks.
    """
    given = [each for each in (name, take, write) if each]
    if len(given) != 1:
        raise o80.InvalidArgument("give one of --name, --take and --write")
    with opened(port) as bus:
        folders = calibration.folders_of(bus, leader)
        if write:
            file = calibration.find(write, folders)
            joints = calibration.read(file)
            put(bus, joints)
        else:
            joints = moved_by_hand(bus) if name else held_by(bus)
            file = calibration.place_for(given[0], folders)
            if file.exists() and calibration.read(file) != joints:
                print(f"the previous file is now {file.rename(file.with_suffix('.json.old'))}")
            calibration.write(file, joints)
        told = [*(f"{joint:14} {each}" for joint, each in joints.items()), *doubts(bus, joints)]
    print(*told, sep="\n")
    print(f"{'read from' if write else 'written to'} {file}")


def doubts(bus: Bus, joints: dict[str, Calibration]) -> list[str]:
    """Describes suspicious ranges of an arm with a published model."""
    return [] if isinstance(bus, DynamixelBus) else calibration.doubts(joints)


def put(bus: Bus, joints: dict[str, Calibration]) -> None:
    bus.tries = PATIENCE
    for joint, each in joints.items():
        if abs(each.offset) > LARGEST_OFFSET and not isinstance(bus, DynamixelBus):
            raise BusError(
                f"{joint}: a servo can store an offset of at most {LARGEST_OFFSET}, got "
                f"{each.offset}: calibrate the arm again; nothing was written"
            )
    for servo, joint in zip(SERVOS, JOINTS, strict=True):
        joints[joint].write(bus, servo)


def moved_by_hand(bus: Bus) -> dict[str, Calibration]:
    """Measures the ranges while the user moves the joints, and writes them into the servos."""
    bus.tries = PATIENCE
    for servo in SERVOS:
        bus.write(servo, bus.TORQUE, 0)
    print("Move each joint to both of its ends, slowly. Then press Enter.")
    ranges = watch(bus, pressed_enter)
    joints = {joint: Calibration.of_motion(*each, bus) for joint, each in ranges.items()}
    for joint, (smallest, largest) in ranges.items():
        if largest - smallest < 200:
            raise BusError(f"{joint} was not moved: nothing was written, begin again")
    put(bus, joints)
    return joints


def watch(bus: Bus, is_over: Callable[[], bool]) -> dict[str, tuple[int, int]]:
    """Measures each joint's range until `is_over`, in encoder steps without offset.

    A jump of more than half a turn is the wrap from 4095 to 0, or back.
    """

    def encoder(servo: int) -> int:
        return bus.read(servo, bus.POSITION) - bus.OFFSET_SIGN * bus.read(servo, bus.OFFSET)

    place = {servo: encoder(servo) for servo in SERVOS}
    ranges = {servo: (start, start) for servo, start in place.items()}
    while True:
        over = is_over()  # the positions read below still count
        for servo, before in place.items():
            step = (encoder(servo) - before + TURN // 2) % TURN - TURN // 2
            place[servo] = now = before + step
            ranges[servo] = min(ranges[servo][0], now), max(ranges[servo][1], now)
        if over:
            return {joint: ranges[servo] for joint, servo in zip(JOINTS, SERVOS, strict=True)}


def pressed_enter() -> bool:
    """Whether a line can be read from the terminal; reads the line."""
    if not select.select([sys.stdin], [], [], 0)[0]:
        return False
    sys.stdin.readline()
    return True


@app.command()
def number(
    arm: Annotated[
        Literal["so101", "so101_leader", "koch", "koch_leader"],
        typer.Argument(help="The arm that the servos are for."),
    ] = "so101",
    port: Port = None,
) -> None:
    """Number the servos of a kit: connect one after the other, each alone."""
    kind, models = ARMS[arm]
    before = None
    with opened(port, kind) as bus:
        for servo, joint in reversed(list(zip(SERVOS, JOINTS, strict=True))):
            needed = bus.MODELS[models[servo - 1]]
            print(f"Connect the servo of {joint} ({needed}), and no other.", flush=True)
            bus.number(next_servo(bus, models[servo - 1], before), servo)
            print(f"{joint} has the number {servo}", flush=True)
            before = servo
    leader = " --leader" if arm.endswith("leader") else ""
    print(f"Connect all of them, then `o80 arms calibrate{leader} --name NAME`.")


def next_servo(bus: Bus, model: int, before: int | None) -> int:
    """Waits until only a new servo of this model answers; returns its number."""
    told = set()
    while True:
        found = bus.found()
        if found == []:
            before = None  # the previous servo was disconnected
            continue
        doubt = "Several servos answer: leave one only."
        if found and len(found) == 1:
            if found[0] == before:
                continue
            try:
                its = bus.read(found[0], bus.MODEL)
            except BusError:  # the plug has no good contact yet
                continue
            if its == model:
                return found[0]
            names = [bus.MODELS.get(each, str(each)) for each in (its, model)]
            doubt = "This servo is of model {}, and one of model {} is needed.".format(*names)
        if doubt not in told:
            print(doubt, flush=True)
        told.add(doubt)


@app.command()
def check(port: Port = None) -> None:
    """Measure unknown properties of real servos; please report the output. Nothing moves far."""
    with opened(port) as bus:
        servos = bus.scan()
        if not servos:
            raise BusError("no servo answers: is the power supply on?")
        print("servo firmware phase delay gain volts heat")
        for servo in servos:
            values = [bus.read(servo, each) for each in (bus.PHASE, bus.RETURN_DELAY, bus.GAIN)]
            firmware = bus.dotted(bus.read(servo, bus.FIRMWARE))
            volts = bus.read(servo, bus.VOLTAGE) / 10
            print(servo, firmware, *values, volts, bus.read(servo, bus.TEMPERATURE))
        print(f"readings of all at once: {readings_take(bus, servos)}")
        behind = bus.answers(bus.read_all([servos[0], 250, servos[-1]], 2)[0])
        goes_on = bus.answered(behind, servos[-1])
        print(f"a reading of all goes on behind a silent servo: {yes(goes_on)}")
        if bus.read(servos[-1], bus.TORQUE):
            print("the torque is on: `o80 arms relax` first, to check its reaction to a goal")
        else:
            print(told_of_torque(bus, servos[-1]))


def told_of_torque(bus: Bus, servo: int) -> str:
    """Tests whether a goal switches torque on (Feetech), or torque sets the goal (Dynamixel)."""
    place = bus.read(servo, bus.POSITION)
    if not isinstance(bus, DynamixelBus):
        bus.write(servo, bus.GOAL, place)
        told = f"a goal switches torque on: {yes(bus.read(servo, bus.TORQUE) == 1)}"
    else:
        bus.write(servo, bus.GOAL, place + 5)
        bus.write(servo, bus.TORQUE, 1)
        told = f"torque makes the place the goal: {yes(bus.read(servo, bus.GOAL) != place + 5)}"
    bus.write(servo, bus.TORQUE, 0)
    return told


def readings_take(bus: Bus, servos: list[int]) -> str:
    request, size = bus.read_all(servos, 8)
    times = []
    for _ in range(100):
        begin = time.perf_counter()
        if bus.answers(request, size):
            times.append(1e3 * (time.perf_counter() - begin))
    worst = statistics.quantiles(times, n=20)[-1] if len(times) > 1 else float("nan")
    middle = statistics.median(times) if times else float("nan")
    return f"{middle:.1f} ms, 95 % below {worst:.1f} ms, {100 - len(times)} of 100 missed"


def yes(is_so: bool) -> str:
    return "yes" if is_so else "no"
