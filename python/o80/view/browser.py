"""Opens a page in the browser of the user."""

import os
import tempfile
import threading
import webbrowser
from pathlib import Path

KEPT = 30.0  # time after which the browser has certainly read the file [s]


def has_screen() -> bool:
    """Whether a browser could show a window."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_browser(url: str) -> bool:
    """Opens an address that holds a token; False if there is no browser.

    The browser opens a file that redirects there and that only this user can read, because others
    can see the arguments of every process.
    """
    descriptor, name = tempfile.mkstemp(prefix="o80-view-", suffix=".html")
    with os.fdopen(descriptor, "w") as file:
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0; url={url}">')
    forget = threading.Timer(KEPT, lambda: Path(name).unlink(missing_ok=True))
    forget.daemon = True
    forget.start()
    return webbrowser.open(Path(name).as_uri())
