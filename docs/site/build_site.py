"""Builds the site from the pages of the tree and the reference: build/site, or FOLDER/site.

A comment `<!-- search: words, other words -->` makes the search find a page by words that its text
does not have.
"""

import json
import re
import shutil
import sys
from pathlib import Path

from sphinx.cmd.build import build_main

from reference import write_reference

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
FOLDER = Path(sys.argv[1]) if sys.argv[1:] else ROOT / "build"
PAGES, SITE = FOLDER / "site_pages", FOLDER / "site"
LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\]]*\])*\])\(([^)#\s]+)(#[^)\s]+)?\)")
NAME = re.compile(r"`(o80(?:_\w+)?\.\w[\w.]*)(?:\(\))?`")
FOUND_BY = re.compile(r"<!-- search: (.*?) -->")
ASIDE = {"build", ".venv", "tests", ".git"}


def sources() -> set[Path]:
    """The pages of the tree, but those for its tests."""
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name not in ASIDE]
    pages = [*ROOT.glob("*.md"), *(page for folder in folders for page in folder.rglob("*.md"))]
    return {*pages, *(ROOT / "tests/proofs").rglob("README.md")}


class Assembly:
    """Copies pages with what they link to; a program of examples becomes a page."""

    def __init__(self) -> None:
        self._pages = sources()

    def write(self) -> None:
        shutil.rmtree(PAGES, ignore_errors=True)
        write_reference(PAGES / "reference")
        for page in sorted(self._pages):
            at = HERE if page.is_relative_to(HERE) else ROOT
            text = page.read_text()
            if at is ROOT:
                parts = re.split(r"(^```.*?^```)", text, flags=re.DOTALL | re.MULTILINE)
                text = "".join(self._linked(page, part) for part in parts)
            file = PAGES / page.relative_to(at)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)

    def _linked(self, page: Path, text: str) -> str:
        if text.startswith("```"):
            return text
        text = FOUND_BY.sub(
            lambda found: f"```{{index}} !{found[1].replace(', ', ', !')}\n```", text
        )
        text = NAME.sub(r"{py:obj}`\1`", text)
        return LINK.sub(lambda match: self._link(page, *match.groups()), text)

    def _link(self, page: Path, text: str, target: str, anchor: str | None) -> str:
        file = (page.parent / target).resolve()
        if ":" in target or file in self._pages:
            return f"{text}({target}{anchor or ''})"
        if file.is_dir():
            inside = file / "README.md" in self._pages
            return f"{text}({target.rstrip('/')}/README.md)" if inside else text[1:-1]
        copy = PAGES / file.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(file, copy)
        shown = ""
        if file.suffix == ".ipynb":
            for cell in json.loads(file.read_text())["cells"]:
                code = cell["cell_type"] == "code"
                shown += ("```python\n{}\n```\n\n" if code else "{}\n\n").format(
                    "".join(cell["source"])
                )
        elif file.is_relative_to(ROOT / "examples"):
            language = {".py": "python", ".service": "ini", ".xml": "xml"}.get(file.suffix, "cpp")
            shown = f"# {file.relative_to(ROOT)}\n\n"
            shown += f"```{{literalinclude}} {file.name}\n:language: {language}\n```\n"
        if shown:
            copy.with_name(f"{file.name}.md").write_text(f"---\norphan: true\n---\n\n{shown}")
            target += ".md"
        return f"{text}({target})"


def main() -> int:
    Assembly().write()
    shutil.rmtree(SITE, ignore_errors=True)
    options = [
        "-W",
        "--keep-going",
        "-q",
        "-j",
        "auto",
        "-c",
        str(HERE),
        "-d",
        str(PAGES / ".doctrees"),
    ]
    failed = build_main([*options, str(PAGES), str(SITE)])
    size = sum(file.stat().st_size for file in SITE.rglob("*") if file.is_file())
    print(f"{SITE}/index.html: {size / 1e6:.1f} MB")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
