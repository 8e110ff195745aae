"""Reads properties of a computer from kernel files below a root folder, which tests replace."""

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

MAX_PROCESSORS = 8192  # of a list such as "0-3,8"
SYS_NICE, IPC_LOCK = 23, 14  # bits of capabilities
CPU = "sys/devices/system/cpu"


@dataclass(frozen=True)
class Thread:
    """A thread, and the processor time it had so far [ticks of 10 ms]."""

    name: str
    processor: int
    ticks: int


@dataclass(frozen=True)
class Interrupt:
    """A source of interrupts, with the counts of each processor so far."""

    number: str
    device: str
    counts: tuple[int, ...]


@dataclass(frozen=True)
class Sample:
    """Counters of the kernel at one moment."""

    uptime: float = 0.0  #: [s]
    threads: dict[int, Thread] = field(default_factory=dict)
    interrupts: dict[str, Interrupt] = field(default_factory=dict)
    stolen: int = 0  #: time stolen by the host of a virtual machine [ticks]
    passed: int = 0  #: all time of all processors [ticks]


class Computer:
    """Reads files below `root`. No method raises: unreadable files are noted and count as empty."""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root
        self.unread: dict[str, str] = {}  #: path and reason

    def text(self, path: str, *, needed: bool = False) -> str:
        """Reads the stripped text of a file. needed: every kernel has it, so note its absence."""
        try:
            content = (self.root / path).read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            if needed:
                self.note(path, "it is not there")
            return ""
        except OSError as error:
            self.note(path, error.strerror or str(error))
            return ""
        found = content.decode(errors="replace").replace("\0", " ").strip()
        if needed and not found:
            self.note(path, "it is empty")
        return found

    def note(self, path: str, reason: str) -> None:
        """Notes that a file could not be read; a thread that has ended meanwhile does not count."""
        if not re.match(r"proc/\d", path):
            self.unread.setdefault("/" + path, reason)

    def number(self, path: str, *, needed: bool = False) -> int | None:
        """Reads a file with one number; None if there is none."""
        text = self.text(path, needed=needed)
        if not text:
            return None
        if not re.fullmatch(r"-?\d{1,19}", text):
            self.note(path, f"'{_short(text)}' is not a number")
            return None
        return int(text)

    def paths(self, pattern: str) -> list[str]:
        """Returns matching paths below the root, in order."""
        try:
            found = [str(path.relative_to(self.root)) for path in self.root.glob(pattern)]
        except OSError:
            return []
        return sorted(found, key=_natural)

    def exists(self, path: str) -> bool:
        """Whether there is such a file or folder."""
        try:
            return (self.root / path).exists()
        except OSError:
            return False

    def processor_list(self, path: str) -> list[int]:
        """Reads a file with a list of processors such as "0-3,8"."""
        text = self.text(path)
        found = processors_of(text)
        if text and not found and text != "(null)":
            self.note(path, f"'{_short(text)}' is not a list of processors")
        return found

    @cached_property
    def processors(self) -> list[int]:
        """Processors that are switched on."""
        lines = re.findall(r"^cpu(\d{1,4}) ", self.text("proc/stat", needed=True), re.MULTILINE)
        return self.processor_list(f"{CPU}/online") or list(map(int, lines))

    @cached_property
    def isolated(self) -> list[int]:
        """Processors on which the kernel puts no thread by itself."""
        return self.processor_list(f"{CPU}/isolated")

    @cached_property
    def loop_processors(self) -> list[int]:
        """Processors for a loop: the isolated ones, else all."""
        return self.isolated or self.processors

    @cached_property
    def words(self) -> dict[str, str]:
        """Options of the kernel's command line."""
        parts = (word.partition("=") for word in self.text("proc/cmdline").split())
        return {name: value for name, _, value in parts}

    @cached_property
    def kernel(self) -> str:
        """Version of the kernel: "6.1.0-18-amd64"."""
        return self.text("proc/sys/kernel/osrelease", needed=True)

    @cached_property
    def release(self) -> dict[str, str]:
        """Names of the distribution, as in /etc/os-release."""
        found = re.findall(r"^(\w+)=(.*)$", self.text("etc/os-release"), re.MULTILINE)
        return {name: value.strip("\"'") for name, value in found}

    @cached_property
    def distributions(self) -> list[str]:
        """The distribution and its parents."""
        return [self.release.get("ID", ""), *self.release.get("ID_LIKE", "").split()]

    @cached_property
    def container(self) -> str:
        """Kind of container in which this runs; empty: none."""
        if self.exists("run/.containerenv"):
            return "podman"
        if self.exists(".dockerenv"):
            return "docker"
        if kind := self.text("run/systemd/container"):
            return kind.split()[0][:20]
        found = re.search(r"(?:^| )container=(\w+)", self.text("proc/1/environ"))
        return found[1] if found else ""

    @cached_property
    def virtual_machine(self) -> str:
        """Maker of the virtual machine in which this runs; empty: none."""
        maker = self.text("sys/class/dmi/id/sys_vendor")
        product = self.text("sys/class/dmi/id/product_name")
        known = re.search(
            r"QEMU|KVM|VMware|VirtualBox|Virtual Machine|Xen|Bochs|Parallels|Amazon EC2|Google",
            f"{maker} {product}",
        )
        info = self.text("proc/cpuinfo", needed=True)
        flags = re.search(r"^flags\s*:.*", info, re.MULTILINE)  # of x86 alone
        guest = flags is not None and re.search(r"\bhypervisor\b", flags[0]) is not None
        if known and (guest or flags is None):
            return known[0]
        return self.text("sys/hypervisor/type") or ("unknown maker" if guest else "")

    def limit(self, name: str) -> int | None:
        """Reads a soft limit of this process; None: unlimited, or unknown."""
        found = re.search(
            rf"^{name} +(\d+|unlimited) ", self.text("proc/self/limits", needed=True), re.MULTILINE
        )
        if found is None:
            self.note("proc/self/limits", f"it has no line '{name}'")
        return None if found is None or found[1] == "unlimited" else int(found[1])

    def may(self, capability: int) -> bool:
        """Whether this process has a capability for the whole machine."""
        users = self.text("proc/self/uid_map")
        if users and "4294967295" not in users:
            return False  # only for processes of its own container
        found = re.search(
            r"^CapEff:\s*([0-9a-f]{1,16})$",
            self.text("proc/self/status", needed=True),
            re.MULTILINE,
        )
        return found is not None and bool(int(found[1], 16) >> capability & 1)

    def control_group(self, controller: str) -> list[str]:
        """Returns the folders of this process's control group and its parents, inner first."""
        folders = []
        for line in self.text("proc/self/cgroup").splitlines():
            _, _, rest = line.partition(":")
            names, _, path = rest.partition(":")
            if controller not in names.split(",") and names:
                continue
            base = Path("sys/fs/cgroup", controller if names else "")
            inner = base / path.lstrip("/")
            around = [inner, *inner.parents]
            folders += [str(each) for each in around if each.is_relative_to(base)][:64]
        return folders

    def sample(self) -> Sample:
        """Samples the counters."""
        uptime = re.match(r"\d{1,12}(\.\d+)?", self.text("proc/uptime", needed=True))
        total = re.match(r"cpu +([\d ]+)", self.text("proc/stat", needed=True))
        ticks = [int(word[:19]) for word in total[1].split()[:8]] if total else []
        return Sample(
            uptime=float(uptime[0]) if uptime else 0.0,
            threads=self._threads(),
            interrupts=self._interrupts(),
            stolen=ticks[7] if len(ticks) > 7 else 0,
            passed=sum(ticks),
        )

    def _threads(self) -> dict[int, Thread]:
        found = {}
        for path in self.paths("proc/[0-9]*/task/[0-9]*/stat"):
            head, _, rest = self.text(path).rpartition(")")
            words = rest.split()
            number = path.split("/")[3]
            if len(words) < 37 or not all(words[i].isdecimal() for i in (11, 12, 36)):
                continue
            used = int(words[11][:18]) + int(words[12][:18])
            name = head.partition("(")[2]
            found[int(number[:18])] = Thread(name, int(words[36][:9]), used)
        return found

    def _interrupts(self) -> dict[str, Interrupt]:
        """Reads interrupts of devices, without timers and signals between processors."""
        heads, *lines = self.text("proc/interrupts", needed=True).splitlines() or [""]
        count = len(heads.split())
        found = {}
        for line in lines:
            number, _, rest = line.partition(":")
            words = rest.split()
            counts = tuple(int(word[:18]) for word in words[:count] if word.isdecimal())
            if number.strip().isdecimal() and len(counts) == count:
                device = " ".join(words[count:][-1:])
                found[number.strip()] = Interrupt(number.strip(), device, counts)
        return found


def processors_of(text: str) -> list[int]:
    """Parses a list of processors such as "0-3,8"; empty if it is invalid."""
    found: list[int] = []
    for part in text.split(",") if text else []:
        match = re.fullmatch(r"(\d{1,4})(?:-(\d{1,4}))?", part.strip())
        if match is None:
            return []
        found += range(int(match[1]), min(int(match[2] or match[1]), MAX_PROCESSORS) + 1)
    return found


def list_of(processors: list[int]) -> str:
    """Formats processors as text such as "0-3,8"."""
    parts: list[list[int]] = []
    for each in sorted(processors):
        if parts and each == parts[-1][-1] + 1:
            parts[-1] = [parts[-1][0], each]
        else:
            parts.append([each])
    return ",".join("-".join(map(str, part)) for part in parts)


def _natural(path: str) -> list[str | int]:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d{1,18})", path)]


def _short(text: str) -> str:
    line = text.split("\n")[0]
    return line if len(line) <= 20 else line[:20] + "..."
