"""`make site` builds the pages and the reference without a warning, and they load nothing else."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from sphinx.util.inventory import InventoryFile

import o80

pytestmark = [pytest.mark.check, pytest.mark.timeout(900)]

ROOT = Path(__file__).resolve().parents[2]
LARGEST = 15e6  # [bytes]
# what a browser fetches by itself
LOADED = re.compile(
    r"<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc=[\"']?([^\"'\s>]+)"
    r"|<link\b(?![^>]*rel=[\"']?canonical)[^>]*\bhref=[\"']?([^\"'\s>]+)"
    r"|@import\s+(?:url\()?[\"']?([^\"');]+)|\burl\([\"']?([^\"')]+)|\bfetch\([\"']([^\"']+)"
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, str(ROOT / "docs/site/build_site.py"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return folder / "site"


def test_it_is_small_and_has_all_parts(site: Path) -> None:
    assert sum(file.stat().st_size for file in site.rglob("*") if file.is_file()) < LARGEST
    for page in ("index", "start", "guides", "explanations", "reference", "search"):
        assert (site / f"{page}.html").exists()


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    loaded = {
        (str(file.relative_to(site)), address)
        for file in site.rglob("*")
        if file.suffix in {".html", ".css", ".js"} and "_downloads" not in file.parts
        for addresses in LOADED.findall(file.read_text())
        for address in addresses
    }
    assert ("index.html", "_static/scripts/furo.js") in {
        (file, address.partition("?")[0]) for file, address in loaded
    }
    assert not [each for each in loaded if re.match(r"(\w+:)?//", each[1])]


def test_every_class_and_error_of_the_headers_has_an_address(site: Path) -> None:
    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="").data
    declared = re.compile(r"^(?:(?:class|struct) (\w+)[^;]*\{|O80_ERROR\((\w+))", re.MULTILINE)
    inner = re.compile(r"^namespace (?!o80 ).*?^}  // namespace", re.MULTILINE | re.DOTALL)
    headers = (file.read_text() for file in (ROOT / "include/o80").rglob("*.hpp"))
    names = {a or b for text in headers for a, b in declared.findall(inner.sub("", text))}

    assert len(names) > 100
    assert names - set(inventory["std:declaration"]) == set()


def test_every_public_name_has_one_address(site: Path) -> None:
    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="").data
    names = {f"o80.{name}" for name in [*vars(o80)["__all__"], "open", "learning"]}
    found = {name for kind, named in inventory.items() if kind[:3] == "py:" for name in named}
    assert names - found == set()

    anchors = re.findall(
        r'id="(?:module-)?(o80\.\w+)"',
        "".join(page.read_text() for page in (site / "reference").rglob("*.html")),
    )
    assert {name: anchors.count(name) for name in names} == dict.fromkeys(names, 1)
