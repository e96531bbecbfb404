"""Results as notebooks show them."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

from sledenv import ContactLaw, Slope, State, simulate, sled
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.words import story
from tests.browser import Browser, data_of, wait_until


def descended(record: str) -> Descent:
    law = ContactLaw.from_restitution(0.2, stiffness=1e7, friction=0.01, rolling_arm=0.001)
    return simulate(sled(), law, Slope(0.14, 12.0), State(0.0, 0.8, 0.3, 8.0, 0.0, -1.0), record=record)


def test_a_descent_shows_its_story_or_with_a_trajectory_its_replay() -> None:
    """The page inside the frame is a whole one."""
    words = descended("rebounds")._repr_html_()
    assert unescape(words) == f"<pre>{story(descended('rebounds'))}</pre>"
    shown = descended("trajectory")._repr_html_()
    (page,) = re.findall(r'srcdoc="([^"]*)"', shown)
    assert data_of(unescape(page))["title"].startswith("Descent: finish after")


def test_the_frame_of_a_notebook_replays(chromium: Browser, tmp_path: Path) -> None:
    """In a page around it the frame has simulated and drawn its table, and nothing is refused."""
    file = tmp_path / "notebook.html"
    file.write_text(f"<!doctype html><meta charset=utf-8><title>x</title>{descended('trajectory')._repr_html_()}")
    chromium.open(file)
    inside = "document.querySelector('iframe').contentDocument"
    wait_until(chromium, f"{inside}.querySelectorAll('#rebounds tbody tr').length > 1")
    wait_until(chromium, f"{inside}.querySelector('#python').textContent")
    assert chromium.log() == []
