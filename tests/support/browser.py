"""Debian's Chromium without a screen or a network, driven through chromedriver."""

import base64
import json
import re
import shutil
import subprocess
import urllib.request
from contextlib import contextmanager
from pathlib import Path

_ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
_FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic"),
    *("--no-first-run", "--disable-background-networking", "--disable-sync"),
    *("--disable-component-update", "--enable-unsafe-swiftshader"),
    "--host-resolver-rules=MAP * ~NOTFOUND",
)


def missing() -> str:
    """Return which of the two programs isn't there; nothing where both are."""
    names = [n for n in ("chromium", "chromedriver") if shutil.which(n) is None]
    return ", ".join(names)


class Browser:
    """A session of chromedriver."""

    def __init__(self, base: str, window: tuple[int, int], folder: Path) -> None:
        arguments = [*_FLAGS, f"--user-data-dir={folder}"]
        arguments.append(f"--window-size={window[0]},{window[1]}")
        options = {"args": arguments, "binary": shutil.which("chromium")}
        wanted = {
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL"},
        }
        self._base = f"{base}/session"
        body = {"capabilities": {"alwaysMatch": wanted}}
        self._base += "/" + self._ask("POST", "", body)["sessionId"]

    def _ask(self, method: str, path: str, body: dict | None = None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self._base + path, data, method=method)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)["value"]

    def open(self, path: Path) -> None:
        self._ask("POST", "/url", {"url": path.resolve().as_uri()})
        self.run(
            "const done = arguments[0]; const ask = () => "
            "document.documentElement.dataset.ready || document.querySelector("
            "'[role=alert]') ? done() : setTimeout(ask, 20); ask();",
            waits=True,
        )

    def run(self, script: str, *values: object, waits: bool = False):
        kind = "async" if waits else "sync"
        body = {"script": script, "args": list(values)}
        return self._ask("POST", f"/execute/{kind}", body)

    def click(self, selector: str, x: int = 0, y: int = 0) -> None:
        """Click an element, so far from its middle."""
        found = self._ask(
            "POST", "/element", {"using": "css selector", "value": selector}
        )
        origin = {_ELEMENT: found[_ELEMENT]}
        self.run("arguments[0].scrollIntoView({block: 'center'})", origin)
        move = {"type": "pointerMove", "origin": origin, "x": x, "y": y}
        press = [{"type": f"pointer{way}", "button": 0} for way in ("Down", "Up")]
        pointer = {"type": "pointer", "id": "mouse", "actions": [move, *press]}
        self._ask("POST", "/actions", {"actions": [pointer]})

    def choose(self, select: str, value: str) -> None:
        """Choose an option, as a person does: with its event."""
        self.run(
            "const s = document.getElementById(arguments[0]); s.value = arguments[1];"
            "s.dispatchEvent(new Event('change'));",
            *(select, value),
        )

    def log(self) -> list[str]:
        """Return the errors that the console had since the last call."""
        entries = self._ask("POST", "/se/log", {"type": "browser"})
        return [e["message"] for e in entries if e["level"] == "SEVERE"]

    def picture(self) -> bytes:
        return base64.b64decode(self._ask("GET", "/screenshot"))

    def quit(self) -> None:
        self._ask("DELETE", "")


@contextmanager
def browser(folder: Path, window: tuple[int, int] = (1400, 1000)):
    """Give a browser with a new profile in a folder."""
    driver = subprocess.Popen(
        [shutil.which("chromedriver"), "--port=0"], stdout=subprocess.PIPE, text=True
    )
    try:
        for line in driver.stdout:
            if found := re.search(r"started successfully on port (\d+)", line):
                break
        session = Browser(f"http://127.0.0.1:{found[1]}", window, folder)
        try:
            yield session
        finally:
            session.quit()
    finally:
        driver.terminate()
        driver.wait(10)
        driver.stdout.close()
