"""The notebook docs/first_hour.ipynb runs from its first cell to its last one."""

import json
import os
import re
from pathlib import Path

import pytest
from pages import DOCS
from processes import run_python

pytestmark = pytest.mark.check
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
