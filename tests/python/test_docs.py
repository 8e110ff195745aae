"""Links, sections and sources that the pages of documentation point to exist."""

import re
from pathlib import Path

import pytest

from o80.base.symptoms import PAGES as PAGES_OF_SYMPTOMS
from o80.base.symptoms import see

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (
    *("apps", "benchmarks", "devices", "docs", "examples", "gateways"),
    *("python", "robots", "simulators", "src", "tests"),
)
PAGES = sorted([*ROOT.glob("*.md"), *(page for f in FOLDERS for page in (ROOT / f).rglob("*.md"))])
LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)")
NAME = re.compile(r"`(?:(\w+)::)?(\w+)`")
SOURCE = re.compile(r"`([\w/]+\.(?:cpp|hpp|py)|\w+(?:/\w+)+)`")  # or a folder
PAGE = re.compile(
    r"(?<![\w./-])((?:(?:benchmarks|docs|python|src|tests)/(?:\w+/)*\w+|[A-Z]+)\.md)(?:#([\w-]+))?"
)
# the notes on protocols, beside their code; all sections have one form
NOTES = [
    ROOT / folder / "README.md"
    for folder in ("src/memory", "src/control", "src/runtime", "python/o80/view")
]
FORM = [
    *("Invariant", "Words", "Who writes", "Who reads"),
    *("What a death leaves", "Which model proves it"),
]
LABEL = re.compile(r"^- \*\*(.*?)\*\*: (.*)$", re.MULTILINE)
INSIDE = [ROOT / "ARCHITECTURE.md", *NOTES]
LARGEST = {page: 12 * 1024 if page.parent == ROOT else 6 * 1024 for page in INSIDE}  # [bytes]
SOURCES = [
    path
    for folder in {*FOLDERS, "include"} - {"docs"}
    for path in (ROOT / folder).rglob("*")
    if path.suffix in {".hpp", ".cpp", ".py"} and path != Path(__file__)
]


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The names of its sections, as code hosts make them."""
    headings = re.findall(r"^#+ (.+)$", without_code(page), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_to_a_file_and_a_section(page: Path) -> None:
    broken = []
    for target, anchor in LINK.findall(without_code(page)):
        if target.startswith(("http:", "https:")):
            continue
        file = (page.parent / target).resolve() if target else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(f"{target}#{anchor}" if anchor else target)
    assert not broken


@pytest.mark.parametrize("page", [*INSIDE, ROOT / "tests/proofs/models/README.md"], ids=name_of)
def test_every_source_that_a_page_names_exists(page: Path) -> None:
    there = [f"/{source.relative_to(ROOT)}" for source in SOURCES]
    named = set(SOURCE.findall(without_code(page)))
    folders = {path for path in named if (ROOT / path).is_dir()}
    assert not [
        path for path in named - folders if not any(file.endswith(f"/{path}") for file in there)
    ]


@pytest.mark.parametrize("page", INSIDE, ids=name_of)
def test_every_member_and_constant_that_a_page_about_the_inside_names_exists(page: Path) -> None:
    words = set(re.findall(r"\w+", "".join(source.read_text() for source in SOURCES)))
    text = "".join(line for line in without_code(page).splitlines(True) if FORM[-1] not in line)
    named = NAME.findall(text)
    assert named
    assert not {name for pair in named for name in pair if name} - words


@pytest.mark.parametrize("page", INSIDE, ids=name_of)
def test_a_page_about_the_inside_is_short(page: Path) -> None:
    assert page.stat().st_size <= LARGEST[page]


@pytest.mark.parametrize("page", NOTES, ids=name_of)
def test_protocols_are_described_in_one_form_with_proofs_that_exist(page: Path) -> None:
    proofs = {path.stem for path in (ROOT / "tests").rglob("*.*")}
    found = 0
    for section in page.read_text().split("\n## ")[1:]:
        labels = LABEL.findall(section)
        if not labels:
            continue
        title = section.splitlines()[0]
        assert [label for label, _ in labels] == FORM, title
        named = {name for pair in NAME.findall(labels[-1][1]) for name in pair if name}
        assert named, title
        assert not named - proofs, title
        found += 1
    assert found >= 4


def test_the_iteration_that_the_architecture_shows_is_that_of_the_loop() -> None:
    loop = (ROOT / "src/robot/loop/loop.cpp").read_text()
    (shown,) = re.findall(
        r"```cpp\n(.*?)```", (ROOT / "ARCHITECTURE.md").read_text(), flags=re.DOTALL
    )
    assert all(part in loop for part in shown.split("\n\n"))


def test_every_page_and_section_that_a_source_names_exists() -> None:
    broken = []
    for source in SOURCES:
        for name, anchor in PAGE.findall(source.read_text()):
            page = ROOT / name
            if not page.exists() or (anchor and anchor not in anchors(page)):
                broken.append(f"{source.relative_to(ROOT)}: {name}#{anchor}")
    assert not broken


def test_each_page_about_a_symptom_is_named_by_errors_or_programs() -> None:
    named = {f"See docs/symptoms/{page.name}." for page in (ROOT / "docs/symptoms").iterdir()}
    assert {see(page) for page in PAGES_OF_SYMPTOMS} == named


def test_the_page_on_compatibility_names_the_formats_of_this_version() -> None:
    page = (ROOT / "docs" / "compatibility.md").read_text()
    for constant, file, phrase in (
        (
            "kJournalCodec",
            "src/runtime/journal/journal_format.hpp",
            "format of its own ({} in 0.1.0)",
        ),
        ("kMotionRules", "src/control/motion/number_plan.hpp", "motion rules ({} in 0.1.0)"),
        ("kSegmentVersion", "src/memory/segment/segment_layout.hpp", "version ({} in 0.1.0)"),
        ("kRobotTableVersion", "include/o80/robot/table.hpp", "built for ({} in 0.1.0)"),
    ):
        (number,) = re.findall(rf"\b{constant} = (\d+);", (ROOT / file).read_text())
        assert phrase.format(number) in page


# ---------------------------------------------------------------------------- the contract

RULE = re.compile(r"^- \*\*([A-Z]\d+)\*\* .+ \((`[\w.]+`(?:, `[\w.]+`)*)\)$", re.MULTILINE)
MENTION = re.compile(r"\brules? ([A-Z]\d+(?:, [A-Z]\d+)*)")
MARK = re.compile(rf"^(?://|#) {MENTION.pattern}$", re.MULTILINE)
TEST = re.compile(r"^(?:TEST\w*\(\s*(\w+),\s*(\w+)\)|(?:async )?def (test_\w+)\()", re.MULTILINE)
SIZES = {"docs/semantics.md": 24, "docs/decisions.md": 8}  # [KiB]


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.is_relative_to(ROOT / "docs")], ids=name_of
)
def test_a_guide_is_one_task(page: Path) -> None:
    assert len(page.read_text().splitlines()) <= 150


@pytest.mark.parametrize("name", SIZES)
def test_a_page_has_the_size_that_a_reader_has_time_for(name: str) -> None:
    assert (ROOT / name).stat().st_size <= SIZES[name] * 1024


def test_every_rule_of_the_contract_names_the_tests_that_name_it() -> None:
    page = (ROOT / "docs" / "semantics.md").read_text()
    rules = RULE.findall(page)
    numbers = [number for number, _ in rules]
    assert len(numbers) >= 100
    assert len(set(numbers)) == len(numbers)
    lines = [line for line in page.splitlines() if line.startswith("- **")]
    assert [line for line in lines if not RULE.match(line)] == [], "rules without a test"
    wanted = {(number, test) for number, names in rules for test in re.findall(r"[\w.]+", names)}

    marked: set[tuple[str, str]] = set()
    mentioned: set[str] = set()
    for source in SOURCES:
        text = source.read_text()
        mentioned.update(n for list_ in MENTION.findall(text) for n in list_.split(", "))
        for mark in MARK.finditer(text):
            test = TEST.search(text, mark.end())
            assert test, f"{source.relative_to(ROOT)}: no test after '{mark[0]}'"
            name = test[3] or f"{test[1]}.{test[2]}"
            marked.update((number, name) for number in mark[1].split(", "))
    assert sorted(mentioned - set(numbers)) == [], "are no rules"
    assert sorted(wanted - marked) == [], "named by a rule, without a comment that names the rule"
    assert sorted(marked - wanted) == [], "names a rule that does not name it"


# ------------------------------------------------------------------------------------------- models


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
