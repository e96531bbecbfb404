"""Maps of how an impact or a descent ends, over what it begins with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.style import BLUE, GREEN, INK, ORANGE, PURPLE, RED, SKY, WIDTH, plain, styled
from sledenv.simulation.records import Mode
from sledenv.simulation.words import mode_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MODE_COLOURS = {
    "slide-roll": SKY,
    "stop-roll": GREEN,
    "slide": ORANGE,
    "stuck": RED,
    "spin-reversal": PURPLE,
    "slip-reversal": BLUE,
    "double-reversal": INK,
}
_TABLE_1 = ("slide-roll", "stop-roll", "slide", "stuck")  # in the order of its rows
_MODE_WORDS = {
    "slide-roll": "slides and rotates",
    "stop-roll": "sliding stops, rolls",
    "slide": "slides without rotation",
    "stuck": "stuck",
    "spin-reversal": "spin reversed",
    "slip-reversal": "slip reversed",
    "double-reversal": "slip and spin reversed",
}


def plot_table_1(
    speed_ratio: np.ndarray, friction: np.ndarray, scenario: np.ndarray, printed: np.ndarray, *, note: str = ""
) -> Figure:
    """Draw Table 1 as a map: which collision scenario of a wheel holds, and which the printed rules admit.

    Parameters
    ----------
    speed_ratio : ndarray, shape (n,)
        Tangential over normal speed of approach u0/v0 [-], the middles of two or more equal cells.
    friction : ndarray, shape (m,)
        f [-], likewise.
    scenario : ndarray of str, shape (m, n)
        The scenario that holds, as :func:`sledenv.closed_forms.wheel.collide_wheel` names it.
    printed : ndarray of str, shape (m, n)
        The rows of Table 1 whose printed rules hold, as in "1 + 3"; hatched where there are several.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        The scenarios on the left, the printed rules over them on the right.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If the shapes do not agree.
    """
    for name, cells in (("scenario", scenario), ("printed", printed)):
        if cells.shape != (len(friction), len(speed_ratio)):
            raise ValueError(f"{name} has shape {cells.shape}: must be {(len(friction), len(speed_ratio))}")
    found = [name for name in _MODE_COLOURS if (scenario == name).any()]
    rows = {name: f"{_TABLE_1.index(name) + 1}  " if name in _TABLE_1 else "" for name in found}
    with styled({"hatch.linewidth": 0.8, "hatch.color": INK}):
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch

        figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        left.set_title("corrected: one scenario everywhere", loc="left")
        right.set_title("as printed: the rules that hold", loc="left")
        for ax, alpha in ((left, 0.85), (right, 0.45)):
            _draw_modes(ax, speed_ratio, friction, scenario, found, alpha)
            ax.set_xlabel("$u_0/v_0$, tangential over normal speed [-]")
        left.set_ylabel("friction coefficient $f$ [-]")
        label: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold"}
        for name in found:
            cell = _inner_cell(scenario == name)
            if cell is not None:
                left.text(speed_ratio[cell[1]], friction[cell[0]], rows[name].strip(), **label)
        many = np.char.find(printed.astype(str), "+") >= 0
        if many.any():
            right.contourf(speed_ratio, friction, many.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
        label |= {"size": 9.0, "bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.0}}
        for rules in np.unique(printed.astype(str)):
            cell = _inner_cell(printed == rules)
            if cell is not None:
                edge = (printed == rules).astype(float)
                right.contour(speed_ratio, friction, edge, levels=[0.5], colors=INK, linewidths=0.8)
                right.text(speed_ratio[cell[1]], friction[cell[0]], rules, **label)
        handles = [Patch(color=_MODE_COLOURS[name], alpha=0.85, label=rows[name] + _MODE_WORDS[name]) for name in found]
        handles.append(Patch(facecolor="none", hatch="///", edgecolor=INK, label="several printed rules hold"))
        figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def plot_mode_map(
    phi: np.ndarray, speed_ratio: np.ndarray, panels: Mapping[str, np.ndarray], *, note: str = ""
) -> Figure:
    """Draw how one impact of an eccentric body ends, over its orientation and direction of approach.

    Parameters
    ----------
    phi : ndarray, shape (n,)
        Orientation at touch [rad], the middles of two or more equal cells.
    speed_ratio : ndarray, shape (m,)
        Tangential over normal speed of approach ``u/|v|`` [-], likewise.
    panels : mapping of str to ndarray of int, shape (m, n)
        Title to :class:`sledenv.Mode` of each cell.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        One map for each title.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there are no panels or the shapes do not agree.
    """
    if not panels:
        raise ValueError("panels is empty: there is nothing to draw")
    for title, modes in panels.items():
        if modes.shape != (len(speed_ratio), len(phi)):
            raise ValueError(f"{title!r} has shape {modes.shape}: must be {(len(speed_ratio), len(phi))}")
    words = {mode: mode_name(mode) for mode in Mode}
    found = [words[mode] for mode in Mode if any((modes == mode).any() for modes in panels.values())]
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch
        from matplotlib.ticker import MultipleLocator

        figure = Figure(figsize=(WIDTH, 1.0 + 3.3 * len(panels)), layout="constrained")
        axes: list[Axes] = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
        for ax, (title, modes) in zip(axes, panels.items(), strict=True):
            names = np.array(["", *words.values()])[modes]
            _draw_modes(ax, np.degrees(phi), speed_ratio, names, found, 0.85)
            ax.set_title(plain(title), loc="left")
            ax.set_ylabel("$u/|v|$ at touch [-]")
            ax.xaxis.set_major_locator(MultipleLocator(45.0))
        axes[-1].set_xlabel("orientation $\\varphi$ at touch [deg]")
        figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
        handles = [Patch(color=_MODE_COLOURS[name], alpha=0.85, label=_MODE_WORDS[name]) for name in found]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), columnspacing=1.2)
    return figure


def plot_jam_map(
    phi: np.ndarray,
    spin: np.ndarray,
    panels: Mapping[str, tuple[np.ndarray, np.ndarray]],
    *,
    mark: tuple[float, float, str] | None = None,
    note: str = "",
) -> Figure:
    """Draw the jam index of descents over orientation and spin at the launch.

    Parameters
    ----------
    phi : ndarray, shape (n,)
        Orientation at the launch [rad], the middles of two or more equal cells.
    spin : ndarray, shape (m,)
        Spin at the launch [rad/s], likewise.
    panels : mapping of str to (ndarray, ndarray of bool), shapes (m, n)
        Title to the jam index of each cell, and whether the descent reached the end of the slope.
    mark : (float, float, str), optional
        Orientation [rad] and spin [rad/s] of a launch to mark, and what it is called.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        One map for each title, all in one scale of colours; hatched where the end is not reached.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there are no panels or the shapes do not agree.
    """
    if not panels:
        raise ValueError("panels is empty: there is nothing to draw")
    for title, cells in panels.items():
        for values in cells:
            if values.shape != (len(spin), len(phi)):
                raise ValueError(f"{title!r} has shape {values.shape}: must be {(len(spin), len(phi))}")
    degrees = np.degrees(phi)
    with styled({"hatch.linewidth": 0.4, "hatch.color": INK}):
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch
        from matplotlib.ticker import MultipleLocator

        figure = Figure(figsize=(WIDTH, 1.3 + 3.2 * len(panels)), layout="constrained")
        axes: list[Axes] = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
        for ax, (title, (jam, finished)) in zip(axes, panels.items(), strict=True):
            image = ax.pcolormesh(degrees, spin, jam, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
            if not finished.all():
                ax.contourf(degrees, spin, ~finished, levels=[0.5, 1.5], colors="none", hatches=["////"])
            if mark is not None:
                ax.plot(
                    np.degrees(mark[0]),
                    mark[1],
                    marker="X",
                    ms=10.0,
                    color=RED,
                    mec="white",
                    ls="",
                    label=plain(mark[2]),
                )
            ax.set_title(plain(title), loc="left")
            ax.set_ylabel("spin $\\omega$ at launch [rad/s]")
            _show_whole_cells(ax, degrees, spin)
            ax.xaxis.set_major_locator(MultipleLocator(45.0))
        axes[-1].set_xlabel("orientation $\\varphi$ at launch [deg]")
        figure.colorbar(image, ax=axes, label="jam index [-]", aspect=32, pad=0.02)
        unfinished = Patch(facecolor="none", hatch="////", edgecolor=INK, label="end of the slope not reached")
        handles: list[Artist] = [unfinished, *axes[0].get_legend_handles_labels()[0]]
        figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _draw_modes(ax: Axes, x: np.ndarray, y: np.ndarray, names: np.ndarray, found: list[str], alpha: float) -> None:
    """Colour the cells of a map by the name of their mode."""
    from matplotlib.colors import ListedColormap

    index = np.zeros(names.shape, dtype=int)
    for i, name in enumerate(found):
        index[names == name] = i
    colours = ListedColormap([_MODE_COLOURS[name] for name in found])
    ax.pcolormesh(
        x, y, index, cmap=colours, vmin=-0.5, vmax=len(found) - 0.5, shading="nearest", alpha=alpha, rasterized=True
    )
    _show_whole_cells(ax, x, y)


def _show_whole_cells(ax: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Limit a map to the outer edges of its cells."""
    ax.set_xlim(1.5 * x[0] - 0.5 * x[1], 1.5 * x[-1] - 0.5 * x[-2])
    ax.set_ylim(1.5 * y[0] - 0.5 * y[1], 1.5 * y[-1] - 0.5 * y[-2])


def _inner_cell(mask: np.ndarray) -> tuple[int, int] | None:
    """Return a cell of a region for a label, None for a sliver without inner cells.

    It is the last to survive peeling; a label is wide, so three cells at the sides go for one above and below.
    """
    cell = None
    while mask.any():
        padded = np.pad(mask, ((1, 1), (3, 3)))
        inner = mask & padded[:-2, 3:-3] & padded[2:, 3:-3] & padded[1:-1, :-6] & padded[1:-1, 6:]
        if cell is not None or inner.any():
            rows, columns = np.nonzero(mask)
            cell = int(rows[len(rows) // 2]), int(columns[len(rows) // 2])
        mask = inner
    return cell
