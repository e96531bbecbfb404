"""Descents in notebooks: the page that replays it, or its story in words."""

from __future__ import annotations

from html import escape

from sledenv.pages.replay import replay_page
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.words import story

_FRAME = '<iframe srcdoc="{page}" title="{title}" style="width: 100%; height: 40rem; border: 0"></iframe>'


def descent_view(descent: Descent) -> str:
    """Return what ``Descent._repr_html_`` shows: without a trajectory the words alone."""
    if not len(descent.trajectory):
        return f"<pre>{escape(story(descent))}</pre>"
    title = f"Descent: {descent.status} after {descent.time:.2f} s"
    return _FRAME.format(page=escape(replay_page(descent, title)), title=escape(title))
