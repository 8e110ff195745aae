"""Runs every block and command of the pages, as a reader would: `make pages ARGS=docs/time.md`.

A page is read in a folder of its own, from its first block to its last one, with the installed
packages. `pages.toml` says what the reader has before, and what is not run, with the reason.
"""

import ast
import asyncio
import contextlib
import faulthandler
import inspect
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
import types
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import o80

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
KNOWN = tomllib.loads(Path(__file__).with_suffix(".toml").read_text())
ASIDE = {"build", ".venv", ".git"}  # and docs/site: lists of pages
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
# until Ctrl-C, or until a robot ends
ENDLESS = re.compile(
    r"(\w+=\w+ )?o80 (run(?!.*--help)|play|ros2|record(?!ings|.*--seconds)|view(?!.*--html)"
    r"|teleop|echo(?!.*--count))\b|python -m o80_(arms|devices).fakes|\S+/fake_arm "
)
LIMIT, BEGIN, END = 200.0, 2.0, 30.0  # of a command, before an endless one counts, of its end [s]
FLAGS = ("g++", "-std=c++20", "-fsyntax-only", "-xc++", "-")


def pages() -> list[str]:
    """All pages with blocks, from the root."""
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name not in ASIDE]
    found = [*ROOT.glob("*.md"), *(page for each in folders for page in each.rglob("*.md"))]
    ours = [page for page in found if not page.is_relative_to(DOCS / "site")]
    return sorted(str(page.relative_to(ROOT)) for page in ours if BLOCK.search(page.read_text()))


def programs(page: str) -> list[str]:
    """Returns the Python blocks of a page in docs/, and of the pages in the folder of its name."""
    files = [DOCS / page, *sorted((DOCS / page).with_suffix("").glob("*.md"))]
    return [
        text
        for each in files
        for _, kind, text in BLOCK.findall(each.read_text())
        if kind[:2] == "py"
    ]


def first_program(page: str) -> str:
    return next(match[0] for match in BLOCK.finditer((ROOT / page).read_text()) if match[2])


def run_programs(page: str, **names: object) -> int:
    """Runs a page's programs in one module; returns their number."""
    blocks = programs(page)
    for program in blocks:
        exec(compile(program, page, "exec"), names)
    return len(blocks)


def commands(block: str) -> Iterator[str]:
    """The commands of a block without language. Where some have a prompt, the rest is output."""
    lines = block.replace("\\\n", " ").splitlines()
    if any(line.startswith("$ ") for line in lines):
        lines = [line[2:] for line in lines if line.startswith("$ ")]
    for line in lines:
        if line.split("#")[0].strip():
            yield from re.split(r" && (?=cmake|o80)", re.sub(r"\s+# .*$", "", line).strip())


class Reader:
    """Follows one page."""

    def __init__(self, page: str) -> None:
        self.page = page
        self.known: dict[str, Any] = KNOWN.get(page, {})
        self.names = types.ModuleType("__main__")
        self.running: list[tuple[str, subprocess.Popen[bytes]]] = []
        self.counts: Counter[str] = Counter()
        self.skips = {
            line: reason
            for reason, lines in self.known.get("not_run", {}).items()
            for line in lines
        }
        self.used: set[str] = set()

    def read(self) -> None:
        sys.path.insert(0, "")
        sys.modules["__main__"] = self.names  # where pickles look for the classes of blocks
        scenes = KNOWN["scenes"]
        told = self.known.get("given", "")
        given = "".join(scenes[name] for name in self.known.get("scene", ())) + told
        given = re.sub(
            r"^@(\S+)$", lambda match: first_program(match[1]), given, flags=re.MULTILINE
        )
        for text, count in ((given, False), ((ROOT / self.page).read_text(), True)):
            before = self.counts.copy()
            for _, language, block in BLOCK.findall(text):
                self.follow(language, block)
            if not count:
                self.counts = before
        while self.running:
            self.end(-1)
        words = {*self.skips, *self.known.get("instead", {}), *self.known.get("saved", {})}
        assert words == self.used, f"{self.page} lacks what pages.toml says: {words - self.used}"

    def follow(self, language: str, block: str) -> None:
        if language in ("text", "json"):  # what programs print
            assert not ENDLESS.match(block), f"{self.page}: a command is no text: {block}"
            self.counts["texts, which a program prints or reads"] += 1
            return
        if file := self.told("saved", block):
            Path(file).write_text(block)
            if f"\npython {file}\n" in (ROOT / self.page).read_text():
                return  # that command runs it
        elif language in ("cmake", "xml"):
            Path({"cmake": "CMakeLists.txt"}.get(language, "model.xml")).write_text(block)
        for text in [block] if language else commands(block):
            if reason := next((r for line, r in self.skips.items() if text.startswith(line)), None):
                self.used |= {line for line in self.skips if text.startswith(line)}
                self.counts[f"not run: {reason}"] += 1
                continue
            endless = not language and bool(ENDLESS.match(text) or text.endswith("&"))
            print(f"{self.page}: {text.splitlines()[0]}", flush=True)
            for old, new in self.known.get("instead", {}).items():
                if old in text:
                    self.used.add(old)
                    text = text.replace(old, new)
            while ends := [
                n for n, (line, _) in enumerate(self.running) if ends_before(line, text)
            ]:
                self.end(ends[0])
            command = self.begin if endless else self.run_command
            run = {"python": self.run_python, "cpp": self.compile, "": command}.get(language)
            faulthandler.dump_traceback_later(LIMIT, exit=True)
            if run:
                run(text)
            checked = text.startswith(("make ", "pip install"))
            self.counts[
                "make or pip: names checked" if checked else f"{language or 'command'} run"
            ] += 1

    def told(self, kind: str, block: str) -> str | None:
        for begin, value in self.known.get(kind, {}).items():
            if block.startswith(begin):
                self.used.add(begin)
                return str(value)
        return None

    def run_python(self, text: str) -> None:
        code = compile(text, self.page, "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
        result = eval(code, vars(self.names))
        if inspect.iscoroutine(result):
            asyncio.run(result)

    def compile(self, text: str) -> None:
        """Compiles a part of a program, within the scene that the page has for it."""
        scene = self.known.get("cpp", ["@"])
        errors = []
        for each in scene:
            program = '#include "o80/robot.hpp"\n' + each.replace("@", text.replace("  ...\n", ""))
            command = [*FLAGS, f"-I{o80.prefix()}/include"]
            done = subprocess.run(command, input=program, capture_output=True, text=True)
            if done.returncode == 0:
                return
            errors.append(done.stderr)
        raise AssertionError(f"{self.page}: does not compile: {text}\n{min(errors, key=len)}")

    def run_command(self, text: str) -> None:
        if text.startswith("make "):
            check_make(text)
        elif text.startswith("pip install"):
            check_pip(text)
        else:
            subprocess.run(["bash", "-ec", text], check=True, timeout=LIMIT)

    def begin(self, text: str) -> None:
        before = {each.name for each in o80.segments() if each.alive}
        text = text.removesuffix("&")
        if text.startswith("o80 run "):
            text += " --gap 60"  # a busy machine halts no robot
        process = subprocess.Popen(["bash", "-c", text], stdin=subprocess.PIPE, process_group=0)
        self.running.append((text, process))
        begun, robot = time.monotonic(), re.match(r"o80 (run|play)\b", text)
        file = re.search(r" (?:-o|>) (\S+)$", text)
        while process.poll() is None and time.monotonic() < begun + END:
            now = {each.name for each in o80.segments() if each.state == "running"}
            written = not file or (Path(file[1]).exists() and Path(file[1]).stat().st_size > 0)
            passed = time.monotonic() > begun + BEGIN
            if (now - before) if robot else passed and written:
                return
            time.sleep(0.05)
        assert process.returncode == 0, f"{self.page}: {text}: does not begin ({process.poll()})"

    def end(self, number: int) -> None:
        """Presses Ctrl-C."""
        text, process = self.running.pop(number)
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        code = process.wait(END)
        assert code in (0, 130, -signal.SIGINT), f"{self.page}: {text}: ended with {code}"


def ends_before(running: str, text: str) -> bool:
    """Whether a reader ends this program first: for its file, or for the name of its robot."""
    file = re.search(r" -o (\S+)", running)
    names = [re.match(r"o80 run .*--segment (\S+)|o80 run (\S+)", each) for each in (running, text)]
    same = all(names) and len({each[1] or each[2] for each in names if each}) == 1
    return same or bool(file and file[1] in text)


def check_make(text: str) -> None:
    targets = re.findall(r"^([\w]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert text.split()[1] in targets, text


def check_pip(text: str) -> None:
    """Checks that folders of our packages and their extras exist."""
    for word in shlex.split(text)[2:]:
        name, _, extras = word.rstrip("]").partition("[")
        if re.match(r"o80\b", name):
            stem = name[4:].replace("-", "_")
            name = str([*ROOT.glob(f"*/{stem}"), ROOT / stem][0]) if stem else "."
        if name.startswith((".", "/")):
            file = (ROOT / name / "pyproject.toml").read_text()
            has = tomllib.loads(file)["project"].get("optional-dependencies", {})
            assert not {*filter(None, extras.split(","))} - {*has}, text


def kill_session(session: int) -> None:
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if os.getsid(int(folder.name)) == session:
                os.kill(int(folder.name), signal.SIGKILL)


def read_page(page: str) -> Counter[str]:
    """Reads a page in a process of its own; returns how many blocks and commands were what."""
    with (
        tempfile.TemporaryDirectory(prefix="page-") as folder,
        contextlib.ExitStack() as stack,
    ):
        segments = (
            f"/dev/shm/pytest-o80-page-{os.getpid()}"  # conftest removes it if this is killed
        )
        stack.callback(shutil.rmtree, segments, ignore_errors=True)
        Path(segments).mkdir()
        for name in ("apps", "examples", "tools"):
            Path(folder, name).symlink_to(ROOT / name)
        own = {"HOME": folder, "O80_DIRECTORY": segments, "MPLBACKEND": "agg", "PYTHONPATH": ""}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        log, counts = Path(folder, "log"), Path(folder, "counts.json")
        with log.open("w") as output:
            process = subprocess.Popen(
                [sys.executable, __file__, "--read", page],
                cwd=folder,
                env=os.environ | own | {"PATH": path},
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            process.wait()
        kill_session(process.pid)
        assert counts.exists(), f"{page}\n{log.read_text()[-6000:]}"
        return Counter(json.loads(counts.read_text()))


def main(words: list[str]) -> int:
    if words[:1] == ["--read"]:
        reader = Reader(words[1])
        reader.read()
        Path("counts.json").write_text(json.dumps(reader.counts))
        return 0
    total: Counter[str] = Counter()
    failed = []
    for page in words or pages():
        begin = time.monotonic()
        try:
            total += read_page(page)
            print(f"{time.monotonic() - begin:5.1f} s  {page}", flush=True)
        except AssertionError as error:
            failed.append(page)
            print(f"FAILED {error}", flush=True)
    for what, count in sorted(total.items()):
        print(f"{count:4} {what}")
    print(f"failed: {', '.join(failed)}" if failed else "all pages passed")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
