"""Descents as HTML pages, as tables and as JSON; imports plot/ for shapes, simulation/ and machine/.

Importing it registers how a notebook shows a descent.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sledenv.simulation.views import register

if TYPE_CHECKING:
    from sledenv.simulation.outcomes import Descent


def _shown(descent: Descent) -> str:
    from sledenv.pages.notebook import descent_view  # which importing sledenv does not wait for

    return descent_view(descent)


register(_shown)
