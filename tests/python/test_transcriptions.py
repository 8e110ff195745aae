"""Models name what is in the product: each file and function after "Transcribed from" exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODELS = [
    path
    for path in sorted((ROOT / "tests" / "proofs" / "models").rglob("*.*"))
    if path.suffix in {".pml", ".cpp", ".hpp"} and "Transcribed from" in path.read_text()
]
TOKEN = re.compile(r"([\w/]+\.[ch]pp)|\(([^)]*)\)")


def sentence(model: Path) -> str:
    """Text from "Transcribed from" to the end of the sentence, in one line."""
    text = model.read_text().partition("Transcribed from ")[2]
    return re.split(r"\.(?=\s)", " ".join(text.replace("\n//", "\n").split()) + " ")[0]


def words(source: Path) -> set[str]:
    """Words of a source and of its header, without comments."""
    headers = [
        *ROOT.glob(f"src/**/{source.stem}.hpp"),
        *ROOT.glob(f"include/o80/*/{source.stem}.hpp"),
    ]
    code = "\n".join(file.read_text() for file in (source, *headers))
    return set(re.findall(r"\w+", re.sub(r"//.*", "", code)))


def missing(model: Path) -> list[str]:
    """Files and names of a model's sentence that do not exist."""
    gone: list[str] = []
    files: list[Path] = []
    folder, complete = Path(), True
    for file, names in TOKEN.findall(sentence(model)):
        if file:
            folder = (ROOT / file).parent if "/" in file else folder
            if not (folder / Path(file).name).is_file():
                gone.append(file)
                continue
            files = [folder / Path(file).name, *([] if complete else files)]
            complete = False
        else:
            complete = True
            there = set[str]().union(*map(words, files))
            gone += [name for name in re.findall(r"\w+", names) if name not in there]
    return gone


def test_there_are_transcriptions() -> None:
    assert len(MODELS) >= 6


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_a_model_names_what_exists(model: Path) -> None:
    assert TOKEN.search(sentence(model))
    assert not missing(model)
