"""The programs of docs/groups.md run."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "groups.md"


def test_the_programs_of_the_page_run(capsys: pytest.CaptureFixture[str]) -> None:
    programs = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(programs) == 5
    names: dict[str, object] = {}
    for program in programs:
        exec(compile(program, str(PAGE), "exec"), names)
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "(16, 10, 2)"
    # the last rows of a burst of 5: the second group follows what the first was observed at
    followed = [float(number) for number in printed[1].strip("[]").split()]
    assert all(0 < number < 0.5 for number in followed)
    assert len(followed) == 2
    assert printed[2].startswith("[0")  # after the reset
    assert printed[3].startswith("(16, 4) ['observed.shoulder', 'observed.elbow', 'extended")
    assert printed[4].startswith("{2: BackendHalted(")
