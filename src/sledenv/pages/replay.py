"""A descent as one HTML page: the page that simulates, opened at this descent, with a recorded motion beside it."""

from __future__ import annotations

import os
from typing import Any, Final, NamedTuple

import numpy as np

from sledenv.machine.files import replacing
from sledenv.pages.play import NamedBody, exact_text, given_values, page_content, simulating_page, told_setting
from sledenv.pages.still import still
from sledenv.plot.trajectories import touches_in
from sledenv.scenarios.sections import BOTH
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import CONTACT_FORCES, FLIGHT_LOSSES
from sledenv.simulation.scene import State
from sledenv.simulation.settings import DEFAULT
from sledenv.simulation.words import setting

_COLUMNS: Final = ("t", *State._fields, "normal", "tangential", "rolling", "feature", "slip", "spin", *FLIGHT_LOSSES)
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
        page_content([context], [body], descent.law, descent.slope, settings),
        still(descent),
        title=title,
        id="descent",
        question=setting(*given),
        own=0,
        axes=BOTH,
        free=BOTH,
        bounds={},
        maps=False,
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
    """What the worker of the page finds of other descents, as JSON."""
    rows = drawable_rows(descent)
    found: dict[str, Any] = {
        "status": str(descent.status),
        "outcome": {name: descent.outcome[name].item() for name in descent.outcome.dtype.names or ()},
        "jam": {name: float(value) for name, value in descent.jam._asdict().items()},
        "launch": descent.launch._asdict(),
        "rebounds": {name: descent.rebounds[name].tolist() for name in descent.rebounds.dtype.names or ()},
        "rows": {**{name: rows[name].tolist() for name in _COLUMNS}, "touches": _touches(descent, rows)},
    }
    return exact_text(found)


def _touches(descent: Descent, rows: np.ndarray) -> list[list[dict[str, Any]]]:
    """Contacts of each row, and how the body moves there."""
    touches = touches_in(descent.body, rows)
    columns = {name: touches.forces[name].tolist() for name in CONTACT_FORCES.names or ()}
    columns |= {name: getattr(touches, name).tolist() for name in ("depth", "gap_rate", "slip_velocity")}
    found: list[list[dict[str, Any]]] = [[] for _ in rows]
    for row, *cells in zip(touches.forces["row"].tolist(), *columns.values(), strict=True):
        found[row].append(dict(zip(columns, cells, strict=True)))
    return found
