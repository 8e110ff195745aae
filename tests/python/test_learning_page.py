"""The programs of docs/learning.md run, and its task is that of the example."""

import re
from pathlib import Path

import gymnasium

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "learning.md"


def test_the_programs_of_the_page_run() -> None:
    programs = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(programs) >= 3
    names: dict[str, object] = {}
    try:
        for program in programs:
            exec(compile(program, str(PAGE), "exec"), names)
    finally:
        gymnasium.registry.pop("mine/Reach-v0", None)
