"""Modules that `import o80` loads, and that every name is there all the same."""

import ast
import importlib
from pathlib import Path

import pytest
from processes import run_python

import o80

PUBLIC: list[str] = vars(o80)["__all__"]  # computed, so type checkers do not see it


def in_a_fresh_interpreter(program: str) -> str:
    return run_python("-c", program).stdout.strip()


def test_import_and_list_load_neither_numpy_nor_a_parser() -> None:
    loaded = "print(sorted({'numpy', 'typer', 'rich'} & set(sys.modules)))"
    assert in_a_fresh_interpreter(f"import sys, o80; {loaded}") == "[]"
    listing = "sys.argv = ['o80', 'list', '--json']; import o80.cli; o80.cli.main()"
    assert in_a_fresh_interpreter(f"import sys; {listing}; {loaded}").endswith("[]")


def test_learning_needs_no_recordings() -> None:
    program = "import sys; sys.modules['mcap'] = None; import o80.learning; print('imported')"
    assert in_a_fresh_interpreter(program) == "imported"


def test_the_first_attach_loads_little_beyond_numpy(segment: str) -> None:
    attach = f"import o80; o80.Frontend({segment!r}).latest()"
    late = "{'json', 'html', 'inspect', 'datetime', 'o80.robots', 'o80.rows.journal', "
    late += "'o80.rows.provenance'}"
    program = f"import sys, numpy; had = set(sys.modules); {attach}; "
    program += f"print(sorted({late} & (set(sys.modules) - had)))"
    with o80.Backend(segment, ["joint"]) as backend:
        backend.publish([0.0])
        assert in_a_fresh_interpreter(program) == "[]"


def test_every_public_name_is_there_and_listed() -> None:
    for name in PUBLIC:
        assert getattr(o80, name) is not None
    assert "open" not in PUBLIC  # `from o80 import *` must not replace the builtin
    assert set(dir(o80)) == {*PUBLIC, "open", "learning"}
    assert not hasattr(o80, "Fronted")


def test_type_checkers_are_told_the_same_names_from_the_same_modules() -> None:
    told = {"__version__"}
    for node in ast.walk(ast.parse(Path(o80.__file__).read_text())):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(str(node.module))
            for name in [alias.name for alias in node.names if alias.asname == alias.name]:
                assert getattr(o80, name) is getattr(module, name)
                told.add(name)
    assert told == set(dir(o80))


@pytest.mark.parametrize(
    ("missing", "use", "extra"),
    [
        ("gymnasium", "o80.learning", "gym"),
        ("stable_baselines3", "o80.learning.stable_baselines3(None)", "stable-baselines3"),
        ("stable_baselines3", "from o80.learning.training import Training", "stable-baselines3"),
        ("zstandard", "o80.open('run.mcap')", "record"),
    ],
)
def test_a_missing_extra_is_named(missing: str, use: str, extra: str) -> None:
    program = f"import sys; sys.modules[{missing!r}] = None; import o80\n"
    program += f"try: {use}\nexcept o80.MissingExtra as error: print(error)"
    said = in_a_fresh_interpreter(program)
    assert f'needs {missing}, which is not installed: pip install "o80[{extra}]"' in said
