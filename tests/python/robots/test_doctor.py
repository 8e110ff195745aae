"""The doctor: findings on recorded computers, and texts about files that it cannot read."""

import json
import re
import shlex
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import o80._core as _core
import pytest
from processes import run_o80

import o80
from o80.robots.doctor import wake_ups
from o80.robots.doctor.check import Finding
from o80.robots.doctor.checks import CHECKS, Priority
from o80.robots.doctor.computer import list_of, processors_of
from o80.robots.doctor.doctor import Report
from o80.robots.doctor.wake_ups import WakeUps, measure, measure_beside_load
from o80.robots.process import Process
from real_time.recorded_computers import RecordedComputer, recorded

CPU = "sys/devices/system/cpu"
# computer, rate [Hz] => culprits in their order, remarks
BARE = ["priority limit", "swap", "locked memory limit", "kernel without PREEMPT_RT"]
BARE += ["sleep states", "frequency governor", "missing isolation"]
EXPECTED = {
    ("preempt_rt", 10_000): ([], []),
    ("preempt_rt", 1000): ([], []),
    ("workstation", 1000): (["kernel without PREEMPT_RT"], ["throttling", "autogroup"]),
    ("workstation", 100): ([], ["throttling", "autogroup"]),
    ("laptop", 5000): (
        [*BARE, "hyper-threads"],
        ["throttling", "autogroup", "transparent huge pages"],
    ),
    ("laptop", 1000): (BARE, ["throttling", "autogroup", "transparent huge pages"]),
    ("laptop", 10): (["priority limit", "swap"], ["throttling", "autogroup"]),
    ("virtual_machine", 1000): (
        ["kernel without PREEMPT_RT", "virtual machine"],
        ["throttling", "transparent huge pages"],
    ),
    ("virtual_machine", 10): ([], ["throttling"]),
    ("container", 1000): (
        ["processor quota", "priority limit", "locked memory limit", "kernel without PREEMPT_RT"],
        ["size of /dev/shm", "throttling", "autogroup"],
    ),
}


def names(report: Report, *, remarks: bool = False) -> list[str]:
    found = [finding.name for finding in report.findings if finding.remark == remarks]
    return [name.removesuffix(" of real-time threads") for name in found]


@pytest.mark.parametrize(("name", "frequency"), EXPECTED, ids=lambda each: str(each))
def test_a_computer_has_the_expected_findings_at_a_rate(
    tmp_path: Path, name: str, frequency: int
) -> None:
    report = recorded(name, tmp_path).examine(frequency)

    assert (names(report), names(report, remarks=True)) == EXPECTED[name, frequency]
    assert report.serves == (not report.culprits)
    assert not report.unread
    for finding in report.findings:
        assert finding.seen
        assert finding.cure
        assert finding.undo or re.search(r"(docker|o80) run|run the robot|remount", finding.cure)
        assert "{" not in re.sub(r"state\{[\d,]+\}", "", f"{finding}")
    assert report.verdict.count(". ") == 0
    assert report.verdict.endswith(".")


def thread(name: str, processor: int, ticks: int) -> str:
    return f"77 ({name}) R {'0 ' * 10}{ticks} 0 {'0 ' * 23}{processor} 0\n"


def interrupts(count: int) -> str:
    return f"  CPU0 CPU1 CPU2 CPU3\n 30: 0 0 0 {count} IR-PCI-MSI 0-edge eth0\n"


LIMITS = "Max locked memory  {}  {} bytes\nMax realtime priority  {}  {} \n"
MOUNT = "25 24 0:23 / {} rw shared:4 - tmpfs tmpfs rw{}\n"
CLOCK = "sys/devices/system/clocksource/clocksource0"
# changes of a computer without findings => the one finding, a part of its figure, of its cure
FAULTS: dict[str, tuple[dict[str, str | tuple[str, str] | None], str, str, str]] = {
    "priority limit 0": (
        {"proc/self/limits": LIMITS.format("unlimited", "unlimited", 0, 0)},
        "priority limit", "0; o80 run needs 81", "--rtprio=99",
    ),
    "priority limit 20": (
        {"proc/self/limits": LIMITS.format("unlimited", "unlimited", 20, 20)},
        "priority limit", "20; o80 run needs 81", "--priority 19",
    ),
    "locked memory 64 kB": (
        {"proc/self/limits": LIMITS.format(65536, 65536, 99, 99)},
        "locked memory limit", "64 KiB", "--memlock=unlimited",
    ),
    "no share of the group": (
        {
            "proc/self/cgroup": "4:cpu,cpuacct:/robots\n",
            "sys/fs/cgroup/cpu/robots/cpu.rt_runtime_us": "0\n",
            "proc/sys/kernel/sched_rt_runtime_us": "999999\n",
            "proc/sys/kernel/sched_rt_period_us": "999999\n",
        },
        "real-time share of the control group", "/sys/fs/cgroup/cpu/robots", "runtime_us=-1",
    ),
    "throttling": (
        {"proc/sys/kernel/sched_rt_runtime_us": "950000\n"},
        "throttling of real-time threads", "950000 us", "runtime_us=-1",
    ),
    "much throttling": (
        {"proc/sys/kernel/sched_rt_runtime_us": "100000\n"},
        "throttling of real-time threads", "100000 us", "runtime_us=-1",
    ),
    "ordinary kernel": (
        {"proc/version": "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC", "sys/kernel/realtime": None},
        "kernel without PREEMPT_RT", "PREEMPT_DYNAMIC", "apt install linux-image-rt-",
    ),
    "virtual machine": (
        {"proc/cpuinfo": "flags : fpu hypervisor\n"}, "virtual machine", "unknown maker", "host",
    ),
    "virtual machine on ARM": (
        {"proc/cpuinfo": "Features : fp\n", "sys/class/dmi/id/sys_vendor": "QEMU\n"},
        "virtual machine", "QEMU", "host",
    ),
    "quota": (
        {"sys/fs/cgroup/user.slice/cpu.max": "150000 100000\n"},
        "processor quota", "1.5 processors", "echo max 100000",
    ),
    "busy neighbour": (
        {"proc/77/task/77/stat": (thread("yes (1) {}", 3, 100), thread("yes (1) {}", 3, 280))},
        "busy neighbours", "'yes (1) {}', thread 77", "sudo taskset -pc 0-2 77",
    ),
    "interrupt storm": (
        {
            "proc/interrupts": (interrupts(5), interrupts(90_005)),
            "proc/77/task/77/stat": (thread("irq/30-eth0", 3, 100), thread("irq/30-eth0", 3, 280)),
        },
        "interrupts", "45000 a second of eth0", "echo 0-2 | sudo tee /proc/irq/30/",
    ),
    "governor": (
        {f"{CPU}/cpu3/cpufreq/scaling_governor": "schedutil\n"},
        "frequency governor", "schedutil (processor 3)", "echo performance",
    ),
    "sleep states": (
        {f"{CPU}/cpu3/cpuidle/state2/disable": "0\n"},
        "sleep states", "C6, 170 us", "state2/disable",
    ),
    "hyper-thread": (
        {f"{CPU}/smt/active": "1\n", f"{CPU}/cpu3/topology/thread_siblings_list": "1,3\n"},
        "hyper-threads", "processors 3 and 1 are one core", "echo 0 | sudo tee /sys/devices",
    ),
    "clock source": (
        {f"{CLOCK}/current_clocksource": "acpi_pm\n"}, "clock source", "acpi_pm", "echo tsc |",
    ),
    "distrusted clock": (
        {f"{CLOCK}/current_clocksource": "hpet\n", f"{CLOCK}/available_clocksource": "hpet\n"},
        "clock source", "hpet", "dmesg",
    ),
    "huge pages": (
        {"sys/kernel/mm/transparent_hugepage/enabled": "[always] madvise never\n"},
        "transparent huge pages", "always", "echo madvise",
    ),
    "swap": (
        {"proc/swaps": "Filename Type Size Used Priority\n/dev/zram0 partition 4194300 0 100\n"},
        "swap", "4095 MiB", "sudo swapoff -a",
    ),
    "small /dev/shm": (
        {"proc/self/mountinfo": MOUNT.format("/dev/shm", ",size=65536k")},
        "size of /dev/shm", "67 MB", "sudo mount -o remount,size=1G",
    ),
    "tiny /dev/shm": (
        {"proc/self/mountinfo": MOUNT.format("/dev/shm", ",size=4m")},
        "size of /dev/shm", "4 MB free", "sudo mount -o remount,size=1G",
    ),
    "read-only /dev/shm": (
        {"proc/self/mountinfo": MOUNT.format("/dev/shm", "").replace(" rw ", " ro,nosuid ")},
        "size of /dev/shm", "read-only", "sudo mount -o remount,rw",
    ),
    "no /dev/shm": (
        {"proc/self/mountinfo": MOUNT.format("/tmp", "")},
        "size of /dev/shm", "not mounted", "sudo mount -t tmpfs",
    ),
    "autogroup": (
        {"proc/sys/kernel/sched_autogroup_enabled": "1\n"}, "autogroup", "on", "enabled=0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_alone_is_the_one_finding(tmp_path: Path, fault: str) -> None:
    files, name, seen, cure = FAULTS[fault]
    computer = recorded("preempt_rt", tmp_path)
    for path, content in files.items():
        before, later = content if isinstance(content, tuple) else (content, None)
        computer.change(path, before, later)

    (finding,) = computer.examine(2000).findings

    assert finding.name == name
    assert seen in finding.seen
    assert cure in finding.cure


def test_settings_that_delay_nothing_are_no_findings(tmp_path: Path) -> None:
    computer = recorded("preempt_rt", tmp_path)
    computer.change("sys/fs/cgroup/user.slice/cpu.max", "400000 100000\n")  # all four
    computer.change("sys/fs/cgroup/cpu.max", "max 100000\n")
    computer.change("proc/sys/kernel/sched_rt_runtime_us", "1000000\n")
    computer.change("proc/self/limits", LIMITS.format("unlimited", "unlimited", 81, 81))
    computer.change("proc/self/mountinfo", MOUNT.format("/dev/shm", ",size=1g"))
    computer.change("proc/interrupts", interrupts(5), interrupts(5))
    computer.change("proc/77/task/77/stat", thread("ls", 3, 100), thread("ls", 3, 130))
    computer.change(f"{CLOCK}/current_clocksource", "kvm-clock\n")
    assert computer.examine(2000).findings == ()


def test_every_check_is_reached_by_a_fault() -> None:
    found = {name for _, name, *_ in FAULTS.values()} | {"missing isolation"}  # of the laptop
    assert found == {check.name for check in CHECKS}


def test_commands_that_cure_the_boot_line_are_undone_by_theirs(tmp_path: Path) -> None:
    line = 'GRUB_DEFAULT=0\nGRUB_CMDLINE_LINUX_DEFAULT="quiet"\nGRUB_CMDLINE_LINUX="a=1 b"\n'
    file = tmp_path / "grub"
    file.write_text(line)
    (finding,) = (
        finding
        for finding in recorded("laptop", tmp_path / "root").examine(1000).findings
        if finding.name == "missing isolation"
    )

    def run(command: str) -> str:
        words = shlex.split(command.split(" && ")[0].replace("/etc/default/grub", str(file)))
        subprocess.run(words[1:], check=True)  # without sudo
        return file.read_text()

    assert 'GRUB_CMDLINE_LINUX="isolcpus=2-3 nohz_full=2-3' in run(finding.cure)
    assert 'LINUX_DEFAULT="quiet"' in file.read_text()
    assert run(finding.undo) == line


MISSED = WakeUps(1000.0, 2.0, iterations=2000, overruns=7, skipped=9)
HELD = replace(MISSED, overruns=0)
FAILED = WakeUps(1000.0, 2.0, failed="no space left in /dev/shm")


@pytest.mark.parametrize(
    ("name", "alone", "loaded", "said"),
    [
        ("preempt_rt", MISSED, None, "did not finish 7 of 2000 iterations in time at 1000 Hz"),
        ("preempt_rt", HELD, HELD, ""),
        ("preempt_rt", HELD, MISSED, "iterations in time at 1000 Hz beside a load, and no cause"),
        ("workstation", HELD, MISSED, " a load: because of the kernel without PREEMPT_RT."),
        ("preempt_rt", HELD, replace(HELD, failed="'arm' runs on this computer"), ""),
        ("laptop", FAILED, MISSED, "could not be measured on this computer: no space left"),
    ],
)
def test_a_computer_that_missed_periods_does_not_serve_even_without_a_cause(
    tmp_path: Path, name: str, alone: WakeUps, loaded: WakeUps | None, said: str
) -> None:
    report = recorded(name, tmp_path).examine(1000, alone, *([loaded] if loaded else []))
    assert report.serves == (not said)
    assert said in report.verdict
    assert alone is not FAILED or report.loaded is None


def test_a_refusal_that_the_robot_met_counts_whatever_the_files_say(tmp_path: Path) -> None:
    refused = ("real-time priority 80 was refused (no)", "locked memory was refused (no)")
    report = recorded("preempt_rt", tmp_path).examine(1000, WakeUps(1000.0, 2.0, refused=refused))
    assert names(report) == ["priority limit", "locked memory limit"]
    assert [finding.seen.split(";")[0] for finding in report.findings] == ["refused", "refused"]

    computer = recorded("preempt_rt", tmp_path / "low")
    computer.change("proc/self/limits", LIMITS.format("unlimited", "unlimited", 20, 20))
    (finding,) = computer.examine(1000, WakeUps(1000.0, 2.0, refused=refused[:1])).findings
    assert not finding.remark
    assert finding.cure.startswith("o80 run ROBOT --policy fifo --priority 19  # within")
    assert "--rtprio=99" in finding.cure


def test_a_priority_of_realtime_kit_is_known_with_and_without_a_measurement(tmp_path: Path) -> None:
    line = "real-time priority 80 was refused (no); RealtimeKit granted {}. Allow it in this shell"
    computer = recorded("laptop", tmp_path)

    def finding(answer: str = "") -> Finding:
        refused = (line.format(answer),) if answer else ()
        measured = WakeUps(1000.0, 2.0, policy="rr", refused=refused) if answer else None
        report = computer.examine(1000, measured)
        return next(each for each in report.findings if each.name == "priority limit")

    granted = finding("20, until it runs for 100 ms")
    assert granted.remark
    assert granted.seen == "0; o80 run needs 81; RealtimeKit granted 20, until it runs for 100 ms"
    assert not finding("none (not you)").remark
    assert finding("none (not you)").seen.endswith("81; RealtimeKit granted none (not you)")
    assert "RealtimeKit" not in finding().cure
    computer.change(Priority.REALTIME_KIT, "[D-BUS Service]\n")
    assert finding().cure.startswith("o80 run ROBOT --policy fifo  # asks RealtimeKit")
    assert not finding().remark
    assert "RealtimeKit" not in finding("none (not you)").cure


def test_a_container_of_another_kind_is_not_told_a_command_of_docker(tmp_path: Path) -> None:
    computer = recorded("container", tmp_path)
    for path in (".dockerenv", "run/.containerenv"):
        computer.change(path, None)
    computer.change("run/systemd/container", "lxc\n")
    cures = [finding.cure for finding in computer.examine(1000).findings]
    assert not any(cure.startswith("lxc") for cure in cures)
    assert "start the container (lxc) with what `docker run --shm-size=1g` would give it" in cures


def test_cures_of_limits_are_those_that_o80_run_says(tmp_path: Path) -> None:
    report = recorded("laptop", tmp_path).examine(1000)
    cures = {finding.name: (finding.cure, finding.undo) for finding in report.findings}
    for name, texts in zip(
        ("priority limit", "locked memory limit"), _core.machine_limits(), strict=True
    ):
        assert all(any(text in part for part in cures[name]) for text in texts)


def holds(content: bytes) -> Callable[[Path], object]:
    return lambda file: file.write_bytes(content)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "missing": lambda _: None,
    "a folder": Path.mkdir,
    "empty": holds(b""),
    "words": holds(b"not what was expected\n"),
    "a huge number": holds(b"9" * 100_000),
    "endless lists": holds(b"0-99999999,5\n" * 50),
    "braces": holds(b"{0} {name} {} ((((( :: ,,, --- %s %d\n" * 50),
    "not text": holds(bytes(range(256)) * 20),
}
NEEDED = {
    f"/proc/{name}"
    for name in (
        *("stat", "version", "swaps", "uptime", "cpuinfo", "interrupts", "self/limits"),
        *("self/mountinfo", "self/status", "sys/kernel/sched_rt_runtime_us"),
        "sys/kernel/osrelease",
    )
}


def damage(file: Path, kind: str) -> None:
    if file.is_dir():
        file.rmdir()
    else:
        file.unlink(missing_ok=True)
    DAMAGES[kind](file)


@pytest.mark.parametrize("kind", DAMAGES)
def test_no_damage_of_all_files_makes_the_doctor_fail(tmp_path: Path, kind: str) -> None:
    computer = recorded("laptop", tmp_path)
    computer.write(computer.before)
    for path in computer.before:
        damage(tmp_path / path, kind)

    report = RecordedComputer(tmp_path, "").examine(1000)

    assert json.dumps(report.as_dict())
    if kind in ("missing", "a folder", "empty"):
        assert set(report.unread) >= NEEDED
        assert "as far as could be read" in report.verdict or report.culprits


def test_what_could_not_be_read_is_part_of_the_verdict(tmp_path: Path) -> None:
    computer = recorded("preempt_rt", tmp_path)
    computer.change("proc/interrupts", None)
    computer.change("proc/sys/kernel/sched_rt_runtime_us", "many\n")
    report = computer.examine(1000)
    assert report.serves
    assert report.verdict.endswith("1000 Hz, as far as could be read.")
    assert report.unread == {
        "/proc/interrupts": "it is not there",
        "/proc/sys/kernel/sched_rt_runtime_us": "'many' is not a number",
    }


def test_lists_of_processors_are_read_and_written() -> None:
    for text in ("", "0", "0-3", "0,2", "0-1,4,6-7"):
        assert list_of(processors_of(text)) == text
    for text in ("-", "a", "0-", "1-2-3", "0;1", "99999999"):
        assert processors_of(text) == []


def test_a_loop_is_measured(segment: str) -> None:
    found = measure(500.0, 0.2, [])
    while found.failed:  # a busy machine may end no iteration in this time
        found = measure(500.0, 0.2, [])
    assert found.iterations > 0
    assert 0 <= found.lateness[0] <= found.lateness[1] <= found.lateness[2]
    assert 0 < found.reader[0] <= found.reader[1] <= found.reader[2]
    assert str(found).startswith(f"{found.iterations} iterations at 500 Hz ({found.policy}), ")
    assert "not measured: " in str(measure(500.0, 0.2, [100_000]))
    assert (
        measure(0.1, 0.05, []).failed
        == "no iteration at 0.1 Hz ended within 0.05 s: raise --seconds"
    )


def test_no_load_disturbs_a_robot_that_runs(
    process: Process, monkeypatch: pytest.MonkeyPatch
) -> None:
    (ours,) = (entry for entry in o80.segments() if entry.name == process.segment)
    for life, runs in (("running", "runs"), ("unknown", "may run")):
        monkeypatch.setattr(wake_ups, "segments", lambda life=life: [replace(ours, life=life)])
        found = measure_beside_load(1000.0, 0.2, [])
        reason = f"'{ours.name}' {runs} on this computer, and a load would disturb it"
        assert found == WakeUps(1000.0, 0.2, failed=reason)


def test_the_command_prints_json_and_its_status_says_whether_this_computer_serves() -> None:
    done = run_o80("doctor", "--json", "--seconds", 0, "--frequency", 1000, code=None, timeout=120)
    report = json.loads(done.stdout)
    assert done.returncode == (0 if report["serves"] else 1)
    assert " ".join(report) == "serves verdict frequency findings measured loaded unread computer"
    assert report["measured"] is report["loaded"] is None
    for finding in report["findings"]:
        assert " ".join(finding) == "name seen effect cure undo delay remark"
    text = run_o80("doctor", "--seconds", 0, "--frequency", 1000, code=done.returncode, timeout=120)
    assert text.stdout.startswith(report["verdict"])
    assert text.stderr == done.stderr == ""
    run_o80("doctor", "--frequency", 0, code=2)
    run_o80("doctor", "--seconds", "nan", code=2)
