"""Programs of the pages in docs/."""

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def programs(page: str) -> list[str]:
    """The blocks of Python in a page."""
    text = (DOCS / page).read_text()
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def run_programs(page: str, **names: object) -> int:
    """Runs them one after the other in one module; their number."""
    blocks = programs(page)
    for program in blocks:
        exec(compile(program, page, "exec"), names)
    return len(blocks)
