"""The whole programs of docs/commands.md, docs/streaming.md and docs/chunks.md run."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def programs(page: str) -> list[str]:
    text = (DOCS / page).read_text()
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_the_first_program_about_commands_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(programs("commands.md")[0], "commands.md", "exec"), {})

    assert capsys.readouterr().out == "COMPLETED 0 [0.  0.5]\n"


def test_programs_about_commands_print_what_they_say(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for verb in ("arm.preview(", "seen=seen"):
        (program,) = (text for text in programs("commands.md") if verb in text)
        exec(compile(program, "commands.md", "exec"), {"__name__": "preview"})

        assert capsys.readouterr().out.splitlines() == re.findall(r"print\(.*\)  # (.*)", program)


def test_the_program_about_chunks_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (program,) = programs("chunks.md")
    exec(compile(program, "chunks.md", "exec"), {"__name__": "chunks"})

    begins, late, skipped, shift = map(int, capsys.readouterr().out.split())
    assert (begins > 0, late >= 0, skipped >= 0, shift >= 0) == (True, True, True, True)


def test_the_programs_about_streaming_run(capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": "streaming"}
    for program in programs("streaming.md"):
        exec(compile(program, "streaming.md", "exec"), names)

    assert capsys.readouterr().out.splitlines() == ["0.0", "True"]
