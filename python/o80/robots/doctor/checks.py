"""Checks: each detects one cause of delays, and has commands to remove and to restore it.

To add a check: derive a class from Check, set its texts, and yield findings from `look`.
"""

import os
import re
from collections.abc import Iterator
from typing import ClassVar

import o80._core as _core
from o80.robots.doctor.check import MATTERS, PRIORITY, Check, Evidence, Finding, in_container
from o80.robots.doctor.computer import CPU, IPC_LOCK, Computer, list_of

LOCKED = 256 << 20  # [bytes] of a robot with the default history, and half as much again


class Priority(Check):
    name = "priority limit"
    delay = 10e-3
    effect = "the loop is an ordinary thread, which waits up to 10 ms while other programs compute"
    of_host = False
    REALTIME_KIT: ClassVar = "usr/share/dbus-1/system-services/org.freedesktop.RealtimeKit1.service"

    def look(self, at: Evidence) -> Iterator[Finding]:
        if at.granted:
            return
        limit = at.computer.limit("Max realtime priority")
        refused = any("real-time priority" in line for line in at.refused)
        found = "refused" if limit is None or limit >= PRIORITY else str(limit)
        said = f"; {at.realtime_kit}" if at.realtime_kit else ""
        seen = f"{found}; o80 run needs {PRIORITY}{said}"
        now, always, undo = _core.machine_limits()[0]
        cure = f"{now}  # for this shell\n{always}  # from the next login on"
        if at.computer.container:
            cure = in_container(at.computer.container, "--cap-add SYS_NICE --ulimit rtprio=99")
            undo = ""
        low = 1 < (limit or 0) < PRIORITY
        lower = f"o80 run ROBOT --policy fifo --priority {(limit or 0) - 1}"
        if at.real_time:
            yield self.found(
                at, seen, remark=True, cure=cure, undo=undo,
                effect="at this lower priority the loop waits for interrupt threads and for "
                "real-time threads of the desktop",
            )  # fmt: skip
        elif low and not refused:
            yield self.found(
                at, seen, remark=True, cure=lower,
                effect="o80 run gets no real-time priority without a lower --priority",
            )  # fmt: skip
        else:
            if not refused and at.computer.exists(self.REALTIME_KIT):
                ask = "o80 run ROBOT --policy fifo  # asks RealtimeKit for a lower one, at once"
                cure = f"{ask}\n{cure}"
            if low:
                cure = f"{lower}  # within the limit of now\n{cure}"
            yield self.found(at, seen, cure=cure, undo=undo)


class GroupShare(Check):
    name = "real-time share of the control group"
    delay = 10e-3
    effect = "the kernel refuses real-time priorities to all processes of this group, root included"
    cure = "sudo sysctl -w kernel.sched_rt_runtime_us=-1"
    undo = "sudo sysctl -w kernel.sched_rt_runtime_us={runtime}"

    def look(self, at: Evidence) -> Iterator[Finding]:
        runtime = at.computer.number("proc/sys/kernel/sched_rt_runtime_us")
        for folder in at.computer.control_group("cpu"):
            share = at.computer.number(f"{folder}/cpu.rt_runtime_us")
            if share == 0 and runtime != -1:
                yield self.found(at, f"0 us, in /{folder}", runtime=runtime or 950000)
                return


class LockedMemory(Check):
    name = "locked memory limit"
    delay = 5e-3
    effect = "--lock-memory is refused: a page that is not resident costs up to 5 ms"
    of_host = False

    def look(self, at: Evidence) -> Iterator[Finding]:
        limit = at.computer.limit("Max locked memory")
        refused = any("locked memory" in line for line in at.refused)
        if not refused and (limit is None or limit >= LOCKED or at.computer.may(IPC_LOCK)):
            return
        seen = "refused" if limit is None else f"{limit >> 10} KiB; a robot needs 256 MiB"
        if at.computer.container:
            cure = in_container(at.computer.container, "--ulimit memlock=-1")
            yield self.found(at, seen, cure=cure)
        else:
            now, always, undo = _core.machine_limits()[1]
            cure = f"{now}  # for this shell\n{always}  # from the next login on"
            yield self.found(at, seen, cure=cure, undo=undo)


class Throttling(Check):
    name = "throttling of real-time threads"
    delay = 50e-3
    effect = (
        "real-time threads that together use more than {share:.0f} % of a processor are stopped "
        "for {pause:.0f} ms of each second; a loop that sleeps in each period never does"
    )
    cure = "sudo sysctl -w kernel.sched_rt_runtime_us=-1"
    undo = "sudo sysctl -w kernel.sched_rt_runtime_us={runtime}"

    def look(self, at: Evidence) -> Iterator[Finding]:
        runtime = at.computer.number("proc/sys/kernel/sched_rt_runtime_us", needed=True)
        period = at.computer.number("proc/sys/kernel/sched_rt_period_us", needed=True)
        if runtime is None or period is None or not 0 <= runtime < period:
            return
        yield self.found(
            at, f"{runtime} us of {period}", share=100 * runtime / period, runtime=runtime,
            delay=(period - runtime) / 1e6, pause=(period - runtime) / period * 1e3,
            remark=runtime >= period / 2,
        )  # fmt: skip


class Preemption(Check):
    name = "kernel without PREEMPT_RT"
    delay = 500e-6
    effect = "the kernel finishes its own work before the loop may run, up to {longest}"
    KERNELS: ClassVar = {
        "debian": ("apt install linux-image-rt-{machine}", "apt remove linux-image-rt-{machine}"),
        "ubuntu": ("pro enable realtime-kernel", "pro disable realtime-kernel"),
        "rhel": ("dnf install kernel-rt", "dnf remove kernel-rt"),
        "arch": ("pacman -S linux-rt", "pacman -R linux-rt"),
        "suse": ("zypper install kernel-rt", "zypper remove kernel-rt"),
    }
    # by preemption model of the kernel [s]
    LONGEST: ClassVar = {"none": 5e-3, "voluntary": 2e-3}

    def look(self, at: Evidence) -> Iterator[Finding]:
        computer = at.computer
        version = computer.text("proc/version", needed=True)
        if "PREEMPT_RT" in version or computer.text("sys/kernel/realtime") == "1" or not version:
            return
        model = self.model(computer, version)
        delay = self.LONGEST.get(model, self.delay)
        seen = f"preempt={model}" if model else "PREEMPT_DYNAMIC, model unknown"
        if delay * at.frequency >= MATTERS > self.delay * at.frequency and "DYNAMIC" in version:
            cure, undo = boot_words(computer, "preempt=full")
        else:
            cure, undo = self.kernel(computer)
        yield self.found(
            at, f"{seen}, kernel {computer.kernel}", cure=cure, undo=undo,
            delay=delay, longest=f"{delay * 1e3:g} ms",
        )  # fmt: skip

    def model(self, computer: Computer, version: str) -> str:
        """Name of the kernel's preemption: none, voluntary, lazy, full; empty: unknown."""
        if "PREEMPT_DYNAMIC" not in version:
            return "full" if " PREEMPT" in version else "none"
        running = re.search(r"\((\w+)\)", computer.text("sys/kernel/debug/sched/preempt"))
        if running or "preempt" in computer.words:
            return running[1] if running else computer.words["preempt"]
        built = computer.text(f"boot/config-{computer.kernel}") if computer.kernel else ""
        chosen = re.search(r"^CONFIG_PREEMPT_(NONE|VOLUNTARY|LAZY)=y", built, re.MULTILINE)
        if chosen:
            return chosen[1].lower()
        return "full" if re.search(r"^CONFIG_PREEMPT=y", built, re.MULTILINE) else ""

    def kernel(self, computer: Computer) -> tuple[str, str]:
        """Returns commands that install and remove a kernel with PREEMPT_RT."""
        machine = {"x86_64": "amd64", "aarch64": "arm64"}.get(os.uname().machine, "amd64")
        for name in computer.distributions:
            for known, commands in self.KERNELS.items():
                if name == known or (name == "opensuse-tumbleweed" and known == "suse"):
                    install, remove = (text.format(machine=machine) for text in commands)
                    return f"sudo {install}  # then boot that kernel", f"sudo {remove}"
        return "boot a kernel that was built with CONFIG_PREEMPT_RT=y", "boot the kernel of before"


class VirtualMachine(Check):
    name = "virtual machine"
    delay = 2e-3
    effect = "the host stops it at any moment, for milliseconds, and nothing here can prevent that"
    cure = "run the robot on the host, or on a computer of its own"
    of_host = False

    def look(self, at: Evidence) -> Iterator[Finding]:
        passed = at.after.passed - at.before.passed
        stolen = 100 * (at.after.stolen - at.before.stolen) / passed if passed > 0 else 0.0
        maker = at.computer.virtual_machine
        if maker:
            yield self.found(at, f"{maker}; the host took {max(stolen, 0):.1f} % of its time")


class Quota(Check):
    name = "processor quota"
    delay = 50e-3
    effect = "ordinary threads are stopped for the rest of each {period:g} ms when it is used up"
    cure = "echo max {period_us} | sudo tee /{file}"
    undo = "echo {text} | sudo tee /{file}"

    def look(self, at: Evidence) -> Iterator[Finding]:
        for folder in at.computer.control_group("cpu"):
            file = f"{folder}/cpu.max"
            text = at.computer.text(file)
            if text.startswith("max") or not text:
                continue
            words = text.split()
            if len(words) != 2 or not all(re.fullmatch(r"\d{1,12}", word) for word in words):
                at.computer.note(file, f"'{text[:20]}' is not a quota")
                continue
            quota, period = map(int, words)
            if quota >= period * len(at.computer.processors):
                continue
            yield self.found(
                at, f"{quota / max(period, 1):.2g} processors, in /{folder}", text=text, file=file,
                period=period / 1e3, period_us=period, remark=at.real_time,
                delay=(period - quota / len(at.computer.processors)) / 1e6,
            )  # fmt: skip


class Neighbours(Check):
    name = "busy neighbours"
    of_host = False
    delay = 100e-6
    effect = "{share:.0f} % of processor {processor}: the loop finds its caches cold{waits}"

    def look(self, at: Evidence) -> Iterator[Finding]:
        busy = at.busy()
        isolated, others = at.computer.isolated, set(at.computer.processors)
        others -= set(isolated)
        guilty = [each for each in busy if each[2] in isolated]
        if not isolated and len({each[2] for each in busy}) >= len(others) > 0:
            guilty = busy  # no processor is left
        waits = "" if at.real_time else ", and waits for its turn"
        for share, number, processor, name in guilty[:3]:
            rest = sorted(others - {processor}) or sorted(others)
            yield self.found(
                at, f"'{name}', thread {number}", share=100 * share, processor=processor,
                waits=waits, delay=Priority.delay if waits else self.delay,
                cure=f"sudo taskset -pc {list_of(rest)} {number}",
                undo=f"sudo taskset -pc {list_of(at.computer.processors)} {number}",
            )  # fmt: skip


class Isolation(Check):
    name = "missing isolation"
    delay = 100e-6
    effect = "{busy}ticks and deferred work of the kernel run on the processor of the loop"

    def look(self, at: Evidence) -> Iterator[Finding]:
        computer = at.computer
        if computer.isolated or not computer.processors:
            return
        processor = computer.processors[-1]
        core = set(computer.processor_list(f"{CPU}/cpu{processor}/topology/thread_siblings_list"))
        rest = sorted(set(computer.processors) - core - {processor})
        if not rest:
            return
        own = list_of(sorted(core | {processor}))
        cure, undo = boot_words(
            computer,
            f"isolcpus={own} nohz_full={own} rcu_nocbs={own} irqaffinity={list_of(rest)}",
        )
        threads = len(at.busy())
        counted = f"{threads} busy thread{'s' if threads > 1 else ''}"
        busy = f"{counted}, threads of the kernel, " if threads else ""
        yield self.found(
            at, f"none of {len(computer.processors)}", busy=busy, undo=undo,
            cure=f"{cure}\no80 run ROBOT --cpus {processor}",
            delay=self.delay if busy else self.delay / 2,
        )  # fmt: skip


class Interrupts(Check):
    name = "interrupts"
    delay = 100e-6
    effect = "{rate} a second interrupt processor {processor}, 5 to 20 us each"
    cure = "echo {rest} | sudo tee /proc/irq/{number}/smp_affinity_list{keeper}"
    undo = "echo {before} | sudo tee /proc/irq/{number}/smp_affinity_list"

    def look(self, at: Evidence) -> Iterator[Finding]:
        computer = at.computer
        for rate, processor, number, device in sorted(at.interrupts(), reverse=True)[:8]:
            # without a processor of its own the loop can go elsewhere, unless they fill its periods
            if processor not in computer.loop_processors or (
                not computer.isolated and rate < at.frequency
            ):
                continue
            often = f"{rate:.0f}" if rate >= 10 else f"{rate:.1f}"
            rest = sorted(set(computer.processors) - {processor, *computer.isolated})
            names = {thread.name for thread in at.after.threads.values()}
            keeper = "\nsudo systemctl stop irqbalance" if "irqbalance" in names else ""
            before = computer.text(f"proc/irq/{number}/smp_affinity_list")
            yield self.found(
                at, f"{often} a second of {device} (number {number})", rate=often, number=number,
                processor=processor, rest=list_of(rest) or processor, keeper=keeper,
                before=before or list_of(computer.processors),
            )  # fmt: skip


class Governor(Check):
    name = "frequency governor"
    delay = 200e-6
    effect = "a processor slows down while the loop sleeps, and begins each iteration slowly"
    cure = f"echo performance | sudo tee /{CPU}/cpu*/cpufreq/scaling_governor"
    undo = f"echo {{governor}} | sudo tee /{CPU}/cpu*/cpufreq/scaling_governor"

    def look(self, at: Evidence) -> Iterator[Finding]:
        for processor in at.computer.loop_processors:
            governor = at.computer.text(f"{CPU}/cpu{processor}/cpufreq/scaling_governor")
            if governor in ("powersave", "ondemand", "conservative", "schedutil"):
                yield self.found(at, f"{governor} (processor {processor})", governor=governor)
                return


class SleepStates(Check):
    name = "sleep states"
    delay = 0.0
    effect = "a processor that sleeps so deeply takes {latency} us to wake"
    cure = f"echo 1 | sudo tee /{CPU}/cpu*/cpuidle/{{states}}/disable"
    undo = f"echo 0 | sudo tee /{CPU}/cpu*/cpuidle/{{states}}/disable"

    def look(self, at: Evidence) -> Iterator[Finding]:
        deep: dict[str, int] = {}
        for processor in at.computer.loop_processors[:1]:
            for folder in at.computer.paths(f"{CPU}/cpu{processor}/cpuidle/state[0-9]*"):
                latency = at.computer.number(f"{folder}/latency") or 0
                off = at.computer.number(f"{folder}/disable")
                if not off and latency * 1e-6 * at.frequency >= MATTERS:
                    deep[folder] = latency
        if deep:
            longest = max(deep.values())
            name = at.computer.text(f"{max(deep, key=lambda f: deep[f])}/name")
            states = ",".join(folder.rpartition("state")[2] for folder in deep)
            yield self.found(
                at, f"{name}, {longest} us", delay=longest * 1e-6, latency=longest,
                states=f"state{{{states}}}" if len(deep) > 1 else f"state{states}",
            )  # fmt: skip


class HyperThreads(Check):
    name = "hyper-threads"
    delay = 50e-6
    effect = "what runs on the other half of the core takes up to half of its speed"

    def look(self, at: Evidence) -> Iterator[Finding]:
        computer = at.computer
        if computer.text(f"{CPU}/smt/active") != "1":
            return
        if not computer.isolated:
            control = f"sudo tee /{CPU}/smt/control"
            yield self.found(at, "on", cure=f"echo off | {control}", undo=f"echo on | {control}")
            return
        for processor in computer.isolated:
            file = f"{CPU}/cpu{processor}/topology/thread_siblings_list"
            for other in set(computer.processor_list(file)) - set(computer.isolated):
                switch = f"sudo tee /{CPU}/cpu{other}/online"
                yield self.found(
                    at, f"processors {processor} and {other} are one core",
                    cure=f"echo 0 | {switch}", undo=f"echo 1 | {switch}",
                )  # fmt: skip


class ClockSource(Check):
    name = "clock source"
    delay = 100e-6
    effect = "each look at the clock takes microseconds, more if several processors look at once"
    undo = "echo {current} | sudo tee /{file}"
    FOLDER: ClassVar = "sys/devices/system/clocksource/clocksource0"
    SLOW: ClassVar = ("hpet", "acpi_pm", "jiffies", "refined-jiffies", "pit", "xen")

    def look(self, at: Evidence) -> Iterator[Finding]:
        file = f"{self.FOLDER}/current_clocksource"
        current = at.computer.text(file, needed=True)
        if current not in self.SLOW:
            return
        offered = at.computer.text(f"{self.FOLDER}/available_clocksource").split()
        fast = [name for name in offered if name not in self.SLOW]
        cure = f"echo {fast[0]} | sudo tee /{file}" if fast else (
            "sudo dmesg | grep -i tsc  # says why the kernel does not trust the processor's clock"
        )  # fmt: skip
        delay = 4e-3 if "jiffies" in current else self.delay
        undo = self.undo if fast else ""
        yield self.found(at, current, current=current, file=file, cure=cure, undo=undo, delay=delay)


class HugePages(Check):
    name = "transparent huge pages"
    delay = 200e-6
    effect = "the kernel joins pages while programs run, and stops them meanwhile"
    cure = "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled"
    undo = "echo always | sudo tee /sys/kernel/mm/transparent_hugepage/enabled"

    def look(self, at: Evidence) -> Iterator[Finding]:
        if "[always]" in at.computer.text("sys/kernel/mm/transparent_hugepage/enabled"):
            yield self.found(at, "always", remark=True)


class Swap(Check):
    name = "swap"
    delay = 10e-3
    effect = "memory that was written to disk takes up to 10 ms to come back{rest}"
    cure = "sudo swapoff -a"
    undo = "sudo swapon -a"

    def look(self, at: Evidence) -> Iterator[Finding]:
        devices = [
            line.split() for line in at.computer.text("proc/swaps", needed=True).splitlines()[1:]
        ]
        sizes = [int(words[2][:18]) for words in devices if len(words) > 2 and words[2].isdecimal()]
        if not sizes:
            return
        locked = next(LockedMemory().look(at), None) is None
        rest = ": of readers and policies; --lock-memory keeps that of the loop" if locked else ""
        yield self.found(at, f"{sum(sizes) >> 10} MiB", rest=rest, remark=locked)


class SharedMemory(Check):
    name = "size of /dev/shm"
    of_host = False
    delay = 1.0
    effect = "a robot takes 27 MB or more, and without room it does not start"
    SMALL: ClassVar = 256 << 20
    FULL: ClassVar = 32 << 20
    UNITS: ClassVar = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30}

    def look(self, at: Evidence) -> Iterator[Finding]:
        mounts = [
            line.split()
            for line in at.computer.text("proc/self/mountinfo", needed=True).split("\n")
        ]
        own = [words for words in mounts if len(words) > 9 and words[4] == "/dev/shm"]
        if not own:
            if any(len(words) > 9 for words in mounts):
                mount = "sudo mount -t tmpfs tmpfs /dev/shm"
                yield self.found(at, "not mounted", cure=mount, undo="sudo umount /dev/shm")
            return
        if "ro" in own[-1][5].split(","):
            change = "sudo mount -o remount,{} /dev/shm"
            yield self.found(
                at, "read-only", effect="no robot starts where no file can be made",
                cure=change.format("rw"), undo=change.format("ro"),
            )  # fmt: skip
        size = re.search(r"(?:^|,)size=(\d{1,18})([kmg]?)(?:,|$)", own[-1][-1])
        total = int(size[1]) * self.UNITS[size[2]] if size else None
        free = total if at.free_memory is None else at.free_memory
        container = at.computer.container
        cure, undo = "sudo mount -o remount,size=1G /dev/shm", ""
        if container:
            cure = in_container(container, "--shm-size=1g")
        elif size:
            undo = f"sudo mount -o remount,size={size[1]}{size[2]} /dev/shm"
        if free is not None and free < self.FULL:
            cure = f"o80 clean\n{cure}" if free != total else cure
            yield self.found(at, f"{free / 1e6:.0f} MB free", cure=cure, undo=undo)
        elif total is not None and total < self.SMALL:
            yield self.found(at, f"{total / 1e6:.0f} MB", cure=cure, undo=undo, remark=True)


class Autogroup(Check):
    name = "autogroup"
    delay = 10e-3
    effect = (
        "ordinary threads of one terminal wait for busy programs in others, up to 10 ms: readers, "
        "policies, and a loop without real-time priority"
    )
    cure = "sudo sysctl -w kernel.sched_autogroup_enabled=0"
    undo = "sudo sysctl -w kernel.sched_autogroup_enabled=1"

    def look(self, at: Evidence) -> Iterator[Finding]:
        if at.computer.number("proc/sys/kernel/sched_autogroup_enabled") == 1:
            yield self.found(at, "on", remark=True)


def boot_words(computer: Computer, words: str) -> tuple[str, str]:
    """Returns commands that add words to the kernel's command line and remove them."""
    if computer.exists("usr/sbin/grubby"):
        change = 'sudo grubby --update-kernel=ALL --{}="{}"  # then restart'
        return change.format("args", words), change.format("remove-args", words)
    if computer.exists("etc/default/grub"):
        make = "update-grub" if computer.exists("usr/sbin/update-grub") else (
            "grub-mkconfig -o /boot/grub/grub.cfg"
        )  # fmt: skip
        change = f"sudo sed -i '{{}}' /etc/default/grub && sudo {make}  # then restart"
        line = f's/^GRUB_CMDLINE_LINUX="/&{words} /'
        return change.format(line), change.format(f"/^GRUB_CMDLINE_LINUX=/s/{words} //")
    return (
        f"add to the kernel's command line: {words}",
        f"take from the kernel's command line: {words}",
    )


CHECKS: tuple[Check, ...] = tuple(each() for each in Check.__subclasses__())
