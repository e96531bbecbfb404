"""A descent as one HTML page to scrub through, offline: strobe picture, time series, rebound table."""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import numpy as np

from sledenv.machine.files import replacing
from sledenv.pages.html import filled
from sledenv.pages.scenes import drawn_body, drawn_slope
from sledenv.pages.words import (
    REBOUND_HEADER,
    metric_name,
    mode_name,
    motion_words,
    part_name,
    rebound_cells,
    setting,
)
from sledenv.plot import energy_layers
from sledenv.plot.grounds import frictions
from sledenv.plot.riders import strobe_poses
from sledenv.plot.shapes import (
    contact_arms,
    contact_spans,
    drawable_rows,
    pace,
    push_at,
    reach,
)
from sledenv.simulation.jam import SHOWN
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import State

_POSES = 12
_COLUMNS = ("t", *State._fields, "normal", "tangential", "feature", "slip", "spin")


class Ghost(NamedTuple):
    """A recorded motion, shown as an outline beside the simulated one, with what both differ by over time.

    The times count from the launch; poses may be less whole turns.
    """

    times: np.ndarray  # [s], shape (n,), increasing
    poses: np.ndarray  # x, y [m], phi [rad], shape (n, 3)
    residuals: np.ndarray  # recorded less simulated pose, [m] and [rad], shape (n, 3)
    used: int  # of the first frames, which the simulated descent was fitted to


def replay_page(descent: Descent, title: str, ghost: Ghost | None = None) -> str:
    """Return the page of a descent, which needs no other file and no network.

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
    content = _content(descent, title) | {"ghost": None if ghost is None else ghost._asdict()}
    return filled("replay.html", data=content)


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


def _content(descent: Descent, title: str) -> dict[str, Any]:
    """What the script of the page draws."""
    body, rows, jam = descent.body, drawable_rows(descent), descent.jam
    film = pace(descent)
    columns = {name: rows[name] for name in _COLUMNS}
    columns["place"] = rows["x"] - contact_arms(body, rows["phi"], rows["feature"])[:, 0]
    columns["friction"] = frictions(descent.law, descent.slope, columns["place"])
    interval = float(rows["t"][-1]) / _POSES
    poses = strobe_poses(body, rows, interval if interval > 0.0 else 1.0)
    return {
        "title": title,
        "setting": setting(body, descent.law, descent.slope, descent.launch),
        "status": str(descent.status),
        "outcome": [
            ("status", str(descent.status)),
            ("time", f"{descent.time:.3f} s"),
            ("position", f"{descent.state.x:z.2f} m"),
            *((metric_name(name), f"{float(getattr(jam, name)):.3f}") for name in SHOWN),
            ("jam index", f"{float(jam.jam_index):.3f}"),
        ],
        "body": drawn_body(body),
        "size": max(reach(body), 1e-6),  # a point mass has none
        "slope": drawn_slope(descent.slope, descent.law.friction),
        "parts": body.parts,
        "motions": [motion_words(slip, spin) for slip in (0, 1) for spin in (0, 1)],
        "rows": columns,
        "energy": energy_layers(descent, rows),
        "film": {"film": film[:, 0], "time": film[:, 1]},
        "strobe": poses[:, :3],
        "contacts": _contacts(descent, film),
        "table": {"columns": REBOUND_HEADER, "rows": rebound_cells(descent)},
    }


def _contacts(descent: Descent, film: np.ndarray) -> list[dict[str, Any]]:
    contacts = []
    spans = contact_spans(descent)
    for i, row in enumerate(descent.rebounds):
        begin, end = film[2 * i + 1 : 2 * i + 3, 1].tolist()
        push = push_at(descent, end)
        place = spans[i, 0] if push is None else push.place
        contacts.append(
            {
                "begin": begin,
                "end": end if row["duration"] > 0.0 else begin,
                "from": spans[i, 0],
                "to": spans[i, 1],
                "place": place,
                "friction": frictions(descent.law, descent.slope, place),
                "tangential": row["tangential_impulse"],
                "normal": row["normal_impulse"],
                "largest": 0.0 if push is None else push.largest,
                "feature": part_name(descent.body, row["feature"]),
                "mode": mode_name(row["mode"]),
            }
        )
    return contacts
