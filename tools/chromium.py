"""Drives headless Chromium over the DevTools protocol."""

import base64
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from websockets.sync.client import ClientConnection, connect

FLAGS = (
    "--headless=new",
    "--no-sandbox",  # tests run as root in containers
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--disable-background-networking",
    "--no-first-run",
    "--remote-debugging-port=0",
)
TIMEOUT = 60.0  # long enough for a slow machine [s]


class Chromium:
    """A browser; `page` opens a tab."""

    def __init__(self) -> None:
        program = shutil.which("chromium")
        assert program is not None, "install Debian's package chromium"
        self._folder = tempfile.mkdtemp(prefix="o80-chromium-")
        home = {**os.environ, "HOME": self._folder}
        # the browser ends with this program
        command = ["setpriv", "--pdeathsig=KILL", program, *FLAGS]
        command += [f"--user-data-dir={self._folder}", "about:blank"]
        quiet = subprocess.DEVNULL
        self._popen = subprocess.Popen(
            command, stdout=quiet, stderr=quiet, env=home, start_new_session=True
        )
        self._port = self._read_port()

    @property
    def pid(self) -> int:
        return self._popen.pid

    def _read_port(self) -> int:
        file = Path(self._folder, "DevToolsActivePort")
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            lines = file.read_text().splitlines() if file.exists() else []
            if len(lines) == 2:
                return int(lines[0])
            time.sleep(0.05)
        raise TimeoutError("Chromium did not start")

    def page(self, url: str, width: int = 1280, height: int = 760, dark: bool = False) -> "Page":
        """Opens an address in a new tab."""
        target = f"http://127.0.0.1:{self._port}/json/new?about:blank"
        with urllib.request.urlopen(urllib.request.Request(target, method="PUT")) as answer:
            address: str = json.load(answer)["webSocketDebuggerUrl"]
        page = Page(connect(address, max_size=None, open_timeout=TIMEOUT))
        page.call("Page.enable")
        page.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        page.call("Emulation.setEmulatedMedia", features=[scheme])
        page.call("Page.navigate", url=url)
        return page

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        os.killpg(self._popen.pid, signal.SIGKILL)  # with its helpers
        self._popen.wait()
        shutil.rmtree(self._folder, ignore_errors=True)


class Page:
    """One tab."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._calls = 0

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Sends a request of the protocol; returns the answer."""
        self._calls += 1
        self._socket.send(json.dumps({"id": self._calls, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(TIMEOUT))
            if message.get("id") == self._calls:
                assert "error" not in message, message
                found: dict[str, Any] = message["result"]
                return found

    def value(self, script: str) -> Any:
        """Evaluates an expression in the page."""
        answer = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, script: str, timeout: float = TIMEOUT) -> Any:
        """Waits until an expression is true, and returns its value."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = self.value(f"(() => {{ try {{ return {script} }} catch {{ return null }} }})()")
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"not in {timeout} s: {script}; the page says: {self.text()}")

    def wait_for_text(self, text: str) -> None:
        """Waits until the page contains a text."""
        self.wait_for(f"document.body.innerText.includes({json.dumps(text)})")

    def text(self) -> str:
        """Returns all visible text."""
        found: str = self.value("document.body.innerText")
        return found

    def picture(self) -> bytes:
        """Takes a screenshot as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot")["data"])

    def close(self) -> None:
        self.call("Page.close")
        self._socket.close()
