"""Maps of how an impact or a descent ends, over what it begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.style import BLUE, GREEN, INK, ORANGE, PURPLE, RED, SKY, WIDTH, plain, styled
from sledenv.simulation.records import Mode
from sledenv.simulation.words import mode_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MODES = {  # colour and words
    "slide-roll": (SKY, "slides and rotates"),
    "stop-roll": (GREEN, "sliding stops, rolls"),
    "slide": (ORANGE, "slides without rotation"),
    "stuck": (RED, "stuck"),
    "spin-reversal": (PURPLE, "spin reversed"),
    "slip-reversal": (BLUE, "slip reversed"),
    "double-reversal": (INK, "slip and spin reversed"),
}
_TABLE_1 = ("slide-roll", "stop-roll", "slide", "stuck")  # in the order of its rows
_ALPHA = 0.85


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
    ValueError
        If the shapes do not agree.
    """
    _check_cells({"scenario": [scenario], "printed": [printed]}, (len(friction), len(speed_ratio)))
    found = [name for name in _MODES if (scenario == name).any()]
    rows = {name: f"{_TABLE_1.index(name) + 1}  " if name in _TABLE_1 else "" for name in found}
    with styled({"hatch.linewidth": 0.8, "hatch.color": INK}):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
        left, right = figure.subplots(1, 2, sharex=True, sharey=True)
        left.set_title("corrected: one scenario everywhere", loc="left")
        right.set_title("as printed: the rules that hold", loc="left")
        for ax, alpha in ((left, _ALPHA), (right, 0.45)):
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
        keys = [*_keys(found, rows), _hatched("///", "several printed rules hold")]
        _finish(figure, note, keys, 3)
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
        Title to :class:`sledenv.simulation.Mode` of each cell.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        One map for each title.

    Raises
    ------
    ValueError
        If there are no panels or the shapes do not agree.
    """
    _check_cells({title: [modes] for title, modes in panels.items()}, (len(speed_ratio), len(phi)))
    words = {mode: mode_name(mode) for mode in Mode}
    found = [words[mode] for mode in Mode if any((modes == mode).any() for modes in panels.values())]
    with styled():
        figure, axes = _over_orientations(panels, 1.0, "touch")
        for ax, modes in zip(axes, panels.values(), strict=True):
            names = np.array(["", *words.values()])[modes]
            _draw_modes(ax, np.degrees(phi), speed_ratio, names, found, _ALPHA)
            ax.set_ylabel("$u/|v|$ at touch [-]")
        _finish(figure, note, _keys(found), min(len(found), 5))
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
    ValueError
        If there are no panels or the shapes do not agree.
    """
    _check_cells(panels, (len(spin), len(phi)))
    degrees = np.degrees(phi)
    with styled({"hatch.linewidth": 0.4, "hatch.color": INK}):
        figure, axes = _over_orientations(panels, 1.3, "launch")
        for ax, (jam, finished) in zip(axes, panels.values(), strict=True):
            image = ax.pcolormesh(degrees, spin, jam, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
            if not finished.all():
                ax.contourf(degrees, spin, ~finished, levels=[0.5, 1.5], colors="none", hatches=["////"])
            if mark is not None:
                x, y, called = np.degrees(mark[0]), mark[1], plain(mark[2])
                ax.plot(x, y, marker="X", ms=10.0, color=RED, mec="white", ls="", label=called)
            ax.set_ylabel("spin $\\omega$ at launch [rad/s]")
            _show_whole_cells(ax, degrees, spin)
        figure.colorbar(image, ax=axes, label="jam index [-]", aspect=32, pad=0.02)
        unfinished = _hatched("////", "end of the slope not reached")
        _finish(figure, note, [unfinished, *axes[0].get_legend_handles_labels()[0]], 2)
    return figure


def _check_cells(panels: Mapping[str, Iterable[np.ndarray]], shape: tuple[int, int]) -> None:
    """Raise ValueError, naming the panel, if there are none or one has another shape."""
    if not panels:
        raise ValueError("panels is empty: there is nothing to draw")
    for title, cells in panels.items():
        for values in cells:
            if values.shape != shape:
                raise ValueError(f"{title!r} has shape {values.shape}: must be {shape}")


def _over_orientations(titles: Iterable[str], more: float, when: str) -> tuple[Figure, list[Axes]]:
    """Return a figure with a map below each other for each title, over the orientation at some time."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator

    titles = list(titles)
    figure = Figure(figsize=(WIDTH, more + 3.25 * len(titles)), layout="constrained")
    axes: list[Axes] = list(figure.subplots(len(titles), 1, sharex=True, squeeze=False)[:, 0])
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(plain(title), loc="left")
        ax.xaxis.set_major_locator(MultipleLocator(45.0))
    axes[-1].set_xlabel(f"orientation $\\varphi$ at {when} [deg]")
    return figure, axes


def _finish(figure: Figure, note: str, keys: Sequence[Artist], columns: int) -> None:
    """Write a note above the panels of a map, and its legend below them."""
    figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
    figure.legend(handles=keys, loc="outside lower center", ncols=columns, columnspacing=1.2)


def _keys(found: Iterable[str], before: Mapping[str, str] | None = None) -> list[Artist]:
    """Entries of the legend for modes, with something before their words."""
    from matplotlib.patches import Patch

    said = {name: (before or {}).get(name, "") + _MODES[name][1] for name in found}
    return [Patch(color=_MODES[name][0], alpha=_ALPHA, label=label) for name, label in said.items()]


def _hatched(hatch: str, label: str) -> Artist:
    from matplotlib.patches import Patch

    return Patch(facecolor="none", hatch=hatch, edgecolor=INK, label=label)


def _draw_modes(ax: Axes, x: np.ndarray, y: np.ndarray, names: np.ndarray, found: list[str], alpha: float) -> None:
    """Colour the cells of a map by the name of their mode."""
    from matplotlib.colors import ListedColormap

    index = np.zeros(names.shape, dtype=int)
    for i, name in enumerate(found):
        index[names == name] = i
    colours = ListedColormap([_MODES[name][0] for name in found])
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
