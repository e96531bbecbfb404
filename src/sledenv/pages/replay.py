"""A descent as one HTML page: the page that simulates, opened at this descent, with a recorded motion beside it."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from sledenv.machine.files import replacing
from sledenv.pages.play import NamedBody, exact_text, given_values, simulating_page, told_setting
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import State
from sledenv.simulation.settings import DEFAULT
from sledenv.simulation.words import setting

_AS_RECORDED = (
    "The numbers of this descent are those that Python has found. It was followed by Euler's method, or trimmed on its "
    "way, which this page does not repeat: nothing can be changed here."
)
_GHOST = (
    "Recorded: dashed outline, at its last frame; dots, its mass centre in each; green, as far as the simulated motion "
    "was fitted to it; grey, beyond."
)


class Ghost(NamedTuple):
    """A recorded motion, shown as an outline beside the simulated one, with what both differ by over time.

    The times count from the launch; poses may be less whole turns.
    """

    times: np.ndarray  # [s], shape (n,), increasing
    poses: np.ndarray  # x, y [m], phi [rad], shape (n, 3)
    used: int  # of the first frames, which the simulated descent was fitted to


def replay_page(descent: Descent, title: str, ghost: Ghost | None = None) -> str:
    """Return the page of a descent, which needs no other file and no network.

    It simulates: the kernel in it finds the very numbers of the descent, and others when something is changed. A
    descent that the page cannot repeat, by Euler's method or trimmed on its way, is written into it instead.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    title : str
        Its heading.
    ghost : Ghost, optional
        A recorded motion to show with it.

    Raises
    ------
    ValueError
        If the descent has no trajectory.
    """
    drawable_rows(descent)  # or an error
    given = descent.body, descent.law, descent.slope, descent.launch
    settings = descent.settings
    if settings is None:
        recorded, settings = _recorded(descent), DEFAULT
    else:
        recorded = None
    context = told_setting("as given", 0, given_values(*given), *given[1:])
    body = NamedBody("body as given", descent.body.typed(), descent.body)
    return simulating_page(
        [context],
        [body],
        descent.law,
        descent.slope,
        settings,
        title=title,
        question=setting(*given),
        ghost=None if ghost is None else ghost._asdict(),
        recorded=recorded,
        notes=([_AS_RECORDED] if recorded else []) + ([_GHOST] if ghost else []),
    )


def write_replay(descent: Descent, file: str | os.PathLike[str], title: str) -> None:
    """Write the page of a descent.

    Parameters
    ----------
    descent, title
        As for :func:`replay_page`.
    file : str or path
        Its place; replaced if it exists.

    Raises
    ------
    OSError
        If the place cannot be written.
    ValueError
        If the descent has no trajectory.
    """
    with replacing(file, ".html", ".htm") as scratch:
        scratch.write_text(replay_page(descent, title), encoding="utf-8")


def _recorded(descent: Descent) -> str:
    """Return what the worker of the page finds of other descents, as JSON."""
    rows = np.isfinite([descent.trajectory[name] for name in State._fields]).all(axis=0)
    shown = replace(descent, trajectory=descent.trajectory[rows])  # without a numerical overflow
    tables = {"rebounds": shown.rebounds, "trajectory": shown.trajectory, "contacts": shown.contacts}
    found: dict[str, Any] = {
        name: {field: rows[field].tolist() for field in rows.dtype.names or () if field != "contacts"}
        for name, rows in tables.items()
    }
    found |= {
        "status": str(descent.status),
        "outcome": {name: descent.outcome[name].item() for name in descent.outcome.dtype.names or ()},
        "jam": descent.jam._asdict(),
        "launch": descent.launch._asdict(),
    }
    return exact_text(found)
