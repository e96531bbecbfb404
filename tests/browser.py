"""A headless Chromium driven over the WebDriver protocol, which needs no package: chromium and chromedriver do."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ELEMENT = "element-6066-11e4-a52e-4f735466cecf"  # the key of an element's id: W3C WebDriver, section 12
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
CHROMEDRIVER = shutil.which("chromedriver")
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None or CHROMEDRIVER is None, reason="needs chromium and chromedriver (Debian: chromium-driver)"
)
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,1400",
)
_DOWN, _UP = {"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}
_LOCAL = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class Browser:
    """One tab; an element is named by its CSS selector."""

    def __init__(self, session: str) -> None:
        self.session = session

    def open(self, file: Path, fragment: str = "") -> None:
        """Load a file anew; ``fragment`` is what stands behind the # of its address."""
        place = file.resolve().as_uri()
        for address in ("about:blank", f"{place}#{fragment}") if fragment else (place,):
            _call("POST", f"{self.session}/url", {"url": address})

    def run(self, script: str, *arguments: Any) -> Any:
        """Value that a script returns."""
        return _call("POST", f"{self.session}/execute/sync", {"script": script, "args": list(arguments)})

    def text(self, selector: str) -> str:
        return str(_call("GET", f"{self._find(selector)}/text"))

    def click(self, selector: str) -> None:
        _call("POST", f"{self._find(selector)}/click", {})

    def press(self, selector: str, keys: str) -> None:
        _call("POST", f"{self._find(selector)}/value", {"text": keys})

    def screen(self, width: int, height: int) -> None:
        """Show pages as on a screen of this size [px], narrower than a window can be.

        The layout changes first and the page hears of it with the next frame, ahead of the callbacks of that frame.
        """
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        command = {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics}
        _call("POST", f"{self.session}/goog/cdp/execute", command)
        wait_until(self, f"innerWidth === {width} && innerHeight === {height}")
        self.run("return new Promise(done => requestAnimationFrame(() => done(true)))")

    def must_be_readable(self, width: int) -> None:
        """Assert that letters are large enough and that the page is not wider than its window [px]."""
        heights = "return [...document.querySelectorAll('svg text')].map(one => one.getBoundingClientRect().height)"
        assert min(self.run(heights)) > 10.0
        assert self.run("return document.documentElement.scrollWidth") <= width

    def colours(self, scheme: str) -> None:
        """Show pages to one who prefers "light" or "dark" ones."""
        wanted = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
        _call("POST", f"{self.session}/goog/cdp/execute", {"cmd": "Emulation.setEmulatedMedia", "params": wanted})

    def drag(self, *places: tuple[float, float], kind: str = "mouse") -> None:
        """Press at the first place of the window [px], move over the others, let go; ``kind`` may be "touch"."""
        first, *others = map(_moved, places)
        self._act([first, _DOWN, *others, _UP], kind)

    def double_click(self, place: tuple[float, float]) -> None:
        """Press twice at a place of the window [px]."""
        self._act([_moved(place), _DOWN, _UP, _DOWN, _UP], "mouse")

    def _act(self, steps: list[dict[str, Any]], kind: str) -> None:
        finger = {"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": steps}
        _call("POST", f"{self.session}/actions", {"actions": [finger]})

    def log(self) -> list[str]:
        """Messages of the console since the last call: errors of the script and refused requests."""
        return [entry["message"] for entry in _call("POST", f"{self.session}/se/log", {"type": "browser"})]

    def _find(self, selector: str) -> str:
        found = _call("POST", f"{self.session}/element", {"using": "css selector", "value": selector})
        return f"{self.session}/element/{found[ELEMENT]}"


@contextmanager
def browser(folder: Path) -> Iterator[Browser]:
    """Start a Chromium whose profile lies in ``folder``, and end it."""
    assert CHROMIUM is not None
    assert CHROMEDRIVER is not None
    options = {"binary": CHROMIUM, "args": [*FLAGS, f"--user-data-dir={folder}"]}
    wanted = {"browserName": "chrome", "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
    with subprocess.Popen(
        [CHROMEDRIVER, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=os.environ
    ) as driver:
        assert driver.stdout is not None
        session = None
        try:
            started = next(line for line in driver.stdout if "started successfully on port" in line)
            server = f"http://127.0.0.1:{int(started.rstrip().rstrip('.').split()[-1])}/session"
            session = f"{server}/{_call('POST', server, {'capabilities': {'alwaysMatch': wanted}})['sessionId']}"
            yield Browser(session)
        finally:
            if session is not None:
                _call("DELETE", session)
            driver.terminate()


def _moved(place: tuple[float, float]) -> dict[str, Any]:
    return {"type": "pointerMove", "duration": 0, "x": round(place[0]), "y": round(place[1])}


def at_speed(page: Browser, factor: float) -> None:
    page.run("const one = $('speed'); one.add(new Option('', arguments[0])); one.value = arguments[0]", str(factor))


def wait_until(page: Browser, condition: str) -> None:
    """Wait two minutes at most: a busy machine may be slow. A single script may run for half a minute."""
    look = (
        "return new Promise(done => { const last = performance.now() + 5000;"
        f"const look = () => {condition} ? done(true) : performance.now() > last ? done(false) : setTimeout(look, 20);"
        "look(); })"
    )
    if not any(page.run(look) for _ in range(24)):
        raise TimeoutError(condition)


def patient(page: str) -> str:
    """A page that simulates, but waits longer for a descent: a busy machine may keep a worker from its work."""
    assert "const PATIENCE = 2;" in page
    return page.replace("const PATIENCE = 2;", "const PATIENCE = 200;")


def assert_needs_nothing(page: str) -> None:
    """Assert that a page is small, and refers to nothing outside itself."""
    assert len(page.encode()) < 700_000
    assert not re.search(r"https?:|//[a-z]+\.|@import|<link|\bsrc=|url\((?!#)", page)
    assert "default-src 'none'" in page


def data_of(page: str) -> dict[str, Any]:
    """Data that a page holds, which must be JSON: no number that JSON does not have."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    data: dict[str, Any] = json.loads(found[1], parse_constant=refuse)
    return data


def _call(method: str, url: str, content: dict[str, Any] | None = None) -> Any:
    data = None if content is None else json.dumps(content).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"}, method=method)
    with _LOCAL.open(request, timeout=60) as answer:
        return json.load(answer)["value"]
