"""One Chromium for all tests of pages: to start it takes longer than most of them do."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.browser import CHROMEDRIVER, CHROMIUM, Browser, browser


@pytest.fixture(scope="session")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if CHROMIUM is None or CHROMEDRIVER is None:
        pytest.skip("needs chromium and chromedriver (Debian: chromium-driver)")
    with browser(tmp_path_factory.mktemp("profile")) as tab:
        yield tab


@pytest.fixture
def chromium(opened: Browser) -> Browser:
    """A tab as when it was opened: a light screen of the usual size, and nothing in its log."""
    opened.screen(1280, 1400)
    opened.colours("light")
    opened.log()
    return opened
