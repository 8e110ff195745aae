"""Blocks of the pages and of the notebook run as they stand there; some print what they say."""

import json
import os
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


@pytest.mark.parametrize(
    ("page", "part"),
    [
        *(("commands.md", part) for part in ("handle.status.name", "arm.preview(", "seen=seen")),
        ("from_the_first_o80.md", "print(observation.desired)"),
    ],
)
def test_programs_print_what_they_say(
    page: str, part: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (program,) = (text for text in programs(page) if part in text)
    exec(compile(program, page, "exec"), {"__name__": "program"})

    assert capsys.readouterr().out.splitlines() == re.findall(r"print\(.*\)  # (.*)", program)


PRINTED = {  # lines of the programs of a page
    "chunks.md": [r"[1-9]\d* \d+ \d+ \d+"],
    "streaming.md": ["0.0", "True"],
    "groups.md": [
        r"\(16, 10, 2\)",
        r"\[ *0\.[0-4]\d* +0\.[0-4]\d*\]",  # follows what the first group was observed at
        r"\[0.*",  # after the reset
        r"\(16, 4\) \['observed.shoulder', 'observed.elbow', 'extended.*",
        r"\{2: BackendHalted\(.*",
    ],
    "time.md": [
        *(r"\(501,\)", r"\(501, 2\)", r"0\.00[0-5]\d*", r"\[0 1 2 3 4 5 6\]", r"\[3 3 4 4 8 8\]"),
        *(r"\[False  True  True  True  True  True  True\]", r"[1-9]\d* [1-9]\d* \d+"),
    ],
}


@pytest.mark.parametrize("page", PRINTED)
def test_programs_of_a_page_print_what_they_should(
    page: str, capsys: pytest.CaptureFixture[str]
) -> None:
    run_programs(page, __name__=page)
    assert re.fullmatch("\n".join(PRINTED[page]) + "\n", capsys.readouterr().out)


def test_the_programs_about_recording_run_one_after_the_other(tmp_path: Path) -> None:
    whole = [each for each in programs("recording.md") if "import o80" in each]
    outputs = [run_python("-c", each, cwd=tmp_path).stdout for each in whole]

    assert len(outputs) >= 4
    assert any(
        "151 (151, 2) []" in each and "('episode', {'number': 2}" in each for each in outputs
    )


def test_the_page_about_the_first_o80_names_verbs_of_a_frontend_that_exist() -> None:
    (table,) = re.findall(
        r"^## Frontends\n(.*?)^## ", (DOCS / "from_the_first_o80.md").read_text(), re.M | re.S
    )
    here = [line.split(" | ")[1] for line in table.splitlines()[2:] if line.count(" | ") > 1]
    verbs = set(re.findall(r"(?<![.\w])(\w+)\(", "".join(here)))

    assert len(here) >= 20
    assert {"add_command", "burst", "history", "wait_for"} <= verbs
    assert not [verb for verb in verbs if not hasattr(o80.Frontend, verb) and verb != "len"]


CELLS = json.loads((DOCS / "first_hour.ipynb").read_text())["cells"]
RUN = """
import json, sys
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
for cell in json.loads(sys.argv[1]):
    shell.run_cell(cell).raise_error()
"""


def texts(kind: str) -> list[str]:
    return ["".join(cell["source"]) for cell in CELLS if cell["cell_type"] == kind]


@pytest.mark.check
def test_all_cells_run_in_ipython_one_after_the_other(tmp_path: Path) -> None:
    environment = os.environ | {"MPLBACKEND": "agg", "IPYTHONDIR": str(tmp_path / "ipython")}
    said = run_python("-c", RUN, json.dumps(texts("code")), cwd=tmp_path, env=environment).stdout

    assert "['COMPLETED', 'COMPLETED', 'COMPLETED']" in said
    assert "outside its limits: from -3 to 3 [rad]" in said
    assert "the first halt\nNone" in said  # resumed
    assert "2.0 s\n151 rows recorded\nrecorded: 151 rows, identical" in said
    assert said.endswith("False\n")  # the robot has stopped


def test_the_notebook_holds_no_outputs_and_its_links_lead_to_files() -> None:
    assert not [cell for cell in CELLS if cell.get("outputs") or cell.get("execution_count")]
    links = re.findall(r"\]\(([^)#]+)", "\n".join(texts("markdown")))
    assert len(links) >= 5
    assert not [link for link in links if not (DOCS / link).exists()]
