"""Every block and command of the pages runs as it stands there; some print what they say."""

import re
from pathlib import Path

import pytest
import typer
from pages import BLOCK, DOCS, KNOWN, pages, programs, read_page, run_programs
from processes import run_python

import o80
from o80.cli.app import COMMANDS, app, register

SLOW = {  # only `make pages` runs them: minutes of training, packages, arms
    "apps/table_tennis/README.md",
    "docs/first_day.md",
    "docs/gallery.md",
    "docs/lerobot.md",
    "docs/learning/rollouts.md",
    "examples/hybrid_push/README.md",
    "robots/arms/README.md",
}


@pytest.mark.check
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", sorted({*pages()} - SLOW))
def test_every_block_and_command_runs(page: str) -> None:
    assert read_page(page).total() > 0


def test_what_a_page_needs_is_known_of_pages_that_exist() -> None:
    assert {*KNOWN} - {"scenes"} - {*pages()} == set()


def test_every_command_in_a_sentence_exists_and_has_its_options() -> None:
    for name in COMMANDS:
        register(name)
    known = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    options = {name: {o for p in each.params for o in p.opts} for name, each in known.items()}
    texts = [BLOCK.sub("", page.read_text()) for page in DOCS.rglob("*.md")]
    found = [each for text in texts for each in re.findall(r"`(o80 [a-z][^`\n]*)`", text)]
    of_packages = ("arms", "ros2", "run")  # and options of robots
    names = [each for each in found if each.split()[1] not in of_packages]
    wrong = [
        command
        for command in names
        if set(re.findall(r"(?<!\S)--?[a-z][\w-]*", command))
        - options.get(command.split()[1], set())
        or command.split()[1] not in options
    ]
    assert len(found) > 150
    assert not wrong


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
    assert run_programs("chunks.md", __name__="chunks") == 1

    begins, late, skipped, shift = map(int, capsys.readouterr().out.split())
    assert (begins > 0, late >= 0, skipped >= 0, shift >= 0) == (True, True, True, True)


def test_the_programs_about_streaming_run(capsys: pytest.CaptureFixture[str]) -> None:
    run_programs("streaming.md", __name__="streaming")

    assert capsys.readouterr().out.splitlines() == ["0.0", "True"]


def test_the_programs_about_groups_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_programs("groups.md") == 5
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "(16, 10, 2)"
    # the last rows of a burst of 5: the second group follows what the first was observed at
    followed = [float(number) for number in printed[1].strip("[]").split()]
    assert all(0 < number < 0.5 for number in followed)
    assert len(followed) == 2
    assert printed[2].startswith("[0")  # after the reset
    assert printed[3].startswith("(16, 4) ['observed.shoulder', 'observed.elbow', 'extended")
    assert printed[4].startswith("{2: BackendHalted(")


def test_the_programs_about_recording_run_one_after_the_other(tmp_path: Path) -> None:
    whole = [each for each in programs("recording.md") if "import o80" in each]
    outputs = [run_python("-c", each, cwd=tmp_path).stdout for each in whole]

    assert len(outputs) >= 4
    assert any(
        "151 (151, 2) []" in each and "('episode', {'number': 2}" in each for each in outputs
    )


def test_the_programs_about_joining_run(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_programs("time.md") == 3
    shape, other, age, *joined, capture = capsys.readouterr().out.splitlines()
    assert joined == [
        "[0 1 2 3 4 5 6]",
        "[3 3 4 4 8 8]",
        "[False  True  True  True  True  True  True]",
    ]
    assert (shape, other) == ("(501,)", "(501, 2)")
    assert 0 < float(age) < 1 / 180
    time, error, epoch = capture.split()
    assert int(time) > 0
    assert int(error) > 0
    assert int(epoch) >= 0


def test_the_page_about_the_first_o80_names_verbs_of_a_frontend_that_exist() -> None:
    (table,) = re.findall(
        r"^## Frontends\n(.*?)^## ", (DOCS / "from_the_first_o80.md").read_text(), re.M | re.S
    )
    here = [line.split(" | ")[1] for line in table.splitlines()[2:] if line.count(" | ") > 1]
    verbs = set(re.findall(r"(?<![.\w])(\w+)\(", "".join(here)))

    assert len(here) >= 20
    assert {"add_command", "burst", "history", "wait_for"} <= verbs
    assert not [verb for verb in verbs if not hasattr(o80.Frontend, verb) and verb != "len"]


def test_the_program_about_the_first_o80_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(programs("from_the_first_o80.md")[1], "from_the_first_o80.md", "exec"), {})

    assert capsys.readouterr().out == "[0.  0.5]\n"
