"""Links, sections and sources that the pages of documentation point to exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("apps", "benchmarks", "devices", "docs", "examples", "robots", "simulators", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for f in FOLDERS for page in (ROOT / f).rglob("*.md"))])
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)")
NAME = re.compile(r"`(?:(\w+)::)?(\w+)`")
SOURCE = re.compile(r"`([\w/]+\.(?:cpp|hpp|py))`")
PAGE = re.compile(
    r"((?:\b(?:docs(?:/\w+)?|tests/proofs/models|benchmarks)/\w+|\b[A-Z]+)\.md)(?:#([\w-]+))?"
)
SOURCES = [
    path
    for folder in ("apps", "devices", "include", "python", "robots", "simulators", "src", "tests")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".hpp", ".cpp", ".py"} and path != Path(__file__)
]


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The names of its sections, as code hosts make them."""
    headings = re.findall(r"^#+ (.+)$", without_code(page), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


def test_there_are_pages() -> None:
    assert len(PAGES) >= 12


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file_and_a_section(page: Path) -> None:
    broken = []
    for target, anchor in LINK.findall(without_code(page)):
        if target.startswith(("http:", "https:")):
            continue
        file = (page.parent / target).resolve() if target else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(f"{target}#{anchor}" if anchor else target)
    assert not broken


@pytest.mark.parametrize("name", ["ARCHITECTURE.md", "tests/proofs/models/README.md"])
def test_every_source_that_a_page_names_exists(name: str) -> None:
    there = [f"/{source.relative_to(ROOT)}" for source in SOURCES]
    named = set(SOURCE.findall(without_code(ROOT / name)))
    assert named
    assert not [path for path in named if not any(file.endswith(f"/{path}") for file in there)]


def test_every_member_and_constant_that_the_architecture_names_exists() -> None:
    words = set(re.findall(r"\w+", "".join(source.read_text() for source in SOURCES)))
    named = NAME.findall(without_code(ROOT / "ARCHITECTURE.md"))
    assert len(named) >= 20
    assert not {name for pair in named for name in pair if name} - words


def test_every_page_and_section_that_a_source_names_exists() -> None:
    broken = []
    for source in SOURCES:
        for name, anchor in PAGE.findall(source.read_text()):
            page = ROOT / name
            if not page.exists() or (anchor and anchor not in anchors(page)):
                broken.append(f"{source.relative_to(ROOT)}: {name}#{anchor}")
    assert not broken
