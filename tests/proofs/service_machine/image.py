"""The initial file system of the machine: systemd, busybox, o80, the arm over UDP and its fake."""

import re
import shutil
import subprocess
from pathlib import Path

from checkout import ROOT
from real_time.image import libraries, pack

HERE = Path(__file__).parent
# of the package systemd: what runs services and keeps their journal
SYSTEMD = ("/lib/systemd/systemd", "/lib/systemd/systemd-journald", "/lib/systemd/systemd-shutdown")
COMMANDS = ("systemctl", "journalctl", "systemd-analyze", "chrt", "busybox")
UNITS = r"/lib/systemd/system/(\w+(-pre)?\.target|systemd-journald(-dev-log)?\.(service|socket))"
USERS = """root:x:0:0:root:/:/bin/sh
robot:x:990:990:robot:/:/bin/sh
ada:x:1000:1000:ada:/:/bin/sh
"""


class NoSystemdError(Exception):
    """Systemd is missing: the text says what, and how to get it."""


def packed_units() -> list[Path]:
    """Targets of systemd and its journal, as Debian's package has them."""
    listed = subprocess.run(["dpkg", "-L", "systemd"], capture_output=True, text=True, check=False)
    found = [Path(line) for line in listed.stdout.splitlines() if re.fullmatch(UNITS, line)]
    if not found:
        raise NoSystemdError("systemd is not installed: `apt-get install systemd` on Debian")
    return found


def put(root: Path, source: Path, place: str | Path) -> None:
    """Copies a file to a path of the machine; its libraries too, if it is a program."""
    target = root / str(place).lstrip("/")
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)
    is_program = source.read_bytes()[:4] == b"\x7fELF"
    for library in libraries(source) if is_program and not statically_linked(source) else ():
        put_library(root, library)


def statically_linked(program: Path) -> bool:
    said = subprocess.run(["ldd", program], capture_output=True, text=True, check=False)
    return said.returncode != 0 or "statically" in said.stdout


def put_library(root: Path, library: Path) -> None:
    place = root / str(library).lstrip("/")
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(library.resolve(), place)


def stage(root: Path, build: Path) -> None:
    """Lays all out in a folder as the machine will see it."""
    shutil.rmtree(root, ignore_errors=True)
    for folder in ("bin", "sbin", "lib", "lib64"):
        (root / "usr" / folder).mkdir(parents=True)
        (root / folder).symlink_to(f"usr/{folder}")
    for folder in ("dev", "proc", "sys", "run", "tmp", "var", "etc/systemd/system", "etc/o80"):
        (root / folder).mkdir(parents=True)
    for program in SYSTEMD:
        put(root, Path(program), program)
    for command in COMMANDS:
        found = shutil.which(command)
        if found is None:
            raise NoSystemdError(f"{command} is missing: run tools/setup.sh test")
        put(root, Path(found).resolve(), f"bin/{command}")
    (root / "bin/sh").symlink_to("busybox")
    (root / "init").symlink_to("/lib/systemd/systemd")
    (root / "etc/passwd").write_text(USERS)
    (root / "etc/group").write_text("root:x:0:\nrobot:x:990:ada\nada:x:1000:\n")
    (root / "etc/nsswitch.conf").write_text("passwd: files\ngroup: files\n")
    (root / "etc/machine-id").write_text("0" * 31 + "1\n")
    (root / "etc/os-release").write_text("ID=o80\nNAME=o80\n")

    put_o80(root, build)
    put(root, HERE / "check.sh", "check.sh")
    put_units(root)


def put_units(root: Path) -> None:
    """The units of systemd, of o80 and of the check, and what the start of the machine wants."""
    etc, lib = "/etc/systemd/system", "/lib/systemd/system"
    for unit in packed_units():
        put(root, unit, unit)
    for own in (*sorted(HERE.glob("*.service")), ROOT / "examples/systemd/o80@.service"):
        put(root, own, f"{etc}/{own.name}")
    (root / etc[1:] / "default.target").symlink_to(f"{lib}/basic.target")
    wanted = {
        "sockets.target": (
            f"{lib}/systemd-journald.socket",
            f"{lib}/systemd-journald-dev-log.socket",
        ),
        "sysinit.target": (f"{lib}/systemd-journald.service",),
        "basic.target": (f"{etc}/check.service",),
    }
    for target, places in wanted.items():
        wants = root / etc[1:] / f"{target}.wants"
        wants.mkdir()
        for place in places:
            (wants / Path(place).name).symlink_to(place)


def put_o80(root: Path, build: Path) -> None:
    """As the install has it: programs find the library and the robots beside them."""
    prefix = root / "opt/o80"
    subprocess.run(
        ["cmake", "--install", build, "--prefix", prefix], check=True, stdout=subprocess.DEVNULL
    )
    for part in ("include", "lib/cmake"):
        shutil.rmtree(prefix / part, ignore_errors=True)
    robots = prefix / "lib/o80/robots"
    for robot in robots.iterdir():
        robot.unlink()
    put(root, build / "lib/examples/udp_arm.so", "opt/o80/lib/o80/robots/udp_arm.so")
    for library in libraries(prefix / "bin/o80-run"):
        if prefix not in library.parents:
            put_library(root, library)
    for program in ("fake_arm", "o80_operator"):
        shutil.copy(build / "bin" / program, prefix / "bin" / program)
    for binary in [*prefix.glob("bin/*"), *prefix.glob("lib/*.so.*"), *robots.iterdir()]:
        if not binary.is_symlink():
            subprocess.run(["strip", binary], check=True)


def make_image(image: Path, build: Path) -> None:
    """Packs the folder beside it that bears its name."""
    stage(image.with_suffix(""), build)
    pack(image)
