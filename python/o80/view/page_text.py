"""The page as one text: all styles and scripts are inside, so that it needs no further request."""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

SCRIPTS = ("vectors.js", "shapes.js", "scene.js", "curves.js", "lists.js", "timeline.js", "main.js")


@dataclass(frozen=True)
class Page:
    """The page and its content security policy: no script or style but its own, no other host."""

    html: bytes
    policy: str


@cache
def page_text() -> Page:
    """The page of `o80 view`."""
    folder = files("o80.view") / "page"
    script = "".join((folder / name).read_text() for name in SCRIPTS)
    script = f'"use strict";\n{script}'
    style = (folder / "style.css").read_text()
    html = (folder / "page.html").read_text()
    html = html.replace("/* style */", style).replace("/* script */", script)
    policy = (
        f"default-src 'none'; connect-src 'self'; img-src data:; script-src '{_hash(script)}'; "
        f"style-src '{_hash(style)}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Page(html.encode(), policy)


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
