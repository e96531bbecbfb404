"""The figures: descents as strobe pictures, impacts and descents in time, energies, and maps of how an impact ends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.descent import Descent
from sledenv.geometry import arms
from sledenv.kernel.records import Mode
from sledenv.outline import (
    arc_centre,
    body_outline,
    contact_spans,
    drawable_rows,
    heavy_side,
    reach,
    strobe_states,
    to_world,
)

if TYPE_CHECKING:
    from types import ModuleType

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, SKY, GREEN, ORANGE, RED, PURPLE = "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7"
INK, GROUND, SHADE, POTENTIAL = "#333333", "#E3E7EC", "#E9EDF2", "#BFC8D2"
STYLE: dict[str, Any] = {
    "font.size": 11.0,
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
}
DASHES = (0, (4, 3))
WIDTH = 9.0  # [in]
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


def plot_strobe(
    descents: Descent | Sequence[Descent],
    *,
    labels: Sequence[str] | None = None,
    frames: int = 14,
    whole: bool = True,
) -> Figure:
    """Draw descents as strobe pictures, one panel each, all to one scale.

    The sled is drawn at equal intervals of time, the same in all panels, coloured by its speed; its darker half holds
    the mass centre.

    Parameters
    ----------
    descents : Descent or sequence of Descent
        Simulated with ``record="trajectory"``.
    labels : sequence of str, optional
        One a panel, put in front of its title.
    frames : int
        About this many poses of the shortest descent, >= 2; poses that would lie on top of each other are left out.
    whole : bool
        Show the slope to its end, otherwise only where the sleds went.

    Returns
    -------
    Figure

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there is no descent, one has no trajectory, ``frames`` < 2 or the number of labels differs.
    """
    descents = [descents] if isinstance(descents, Descent) else list(descents)
    if not descents:
        raise ValueError("descents is empty: there is nothing to draw")
    if labels is not None and len(labels) != len(descents):
        raise ValueError(f"{len(labels)} labels for {len(descents)} descents")
    if frames < 2:
        raise ValueError(f"frames = {frames!r}: must be >= 2")
    with _matplotlib().rc_context(STYLE):
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D

        tracks = [drawable_rows(descent) for descent in descents]
        ends = [float(rows["t"][-1]) for rows in tracks]
        interval = _round_interval(max(min(ends), max(ends) / 3.0) / (frames - 1))
        fastest = max(float(np.hypot(rows["u"], rows["v"]).max()) for rows in tracks)
        speed = ScalarMappable(Normalize(0.0, fastest if fastest > 0.0 else 1.0), "viridis")
        boxes = [_box(descent, rows, whole) for descent, rows in zip(descents, tracks, strict=True)]
        low = min(box[0, 0] for box in boxes)
        high = max(box[1, 0] for box in boxes)
        heights = [float(np.clip(8.0 * (box[1, 1] - box[0, 1]) / (high - low), 1.0, 4.5)) for box in boxes]
        figure = Figure(figsize=(WIDTH, sum(heights) + 0.35 * len(descents) + 1.0), layout="constrained")
        grid = figure.subplots(len(descents), 1, sharex=True, squeeze=False, height_ratios=heights)
        axes: list[Axes] = list(grid[:, 0])
        for i, (ax, descent, rows, box) in enumerate(zip(axes, descents, tracks, boxes, strict=True)):
            ax.set_xlim(low, high)
            ax.set_ylim(box[0, 1], box[1, 1])
            ax.set_aspect("equal")
            ax.set_ylabel("height [m]")
            ax.set_title(_outcome(descent) if labels is None else f"{labels[i]}: {_outcome(descent)}", loc="left")
            _draw_slope(ax, descent)
            _draw_contacts(ax, descent)
            _draw_poses(ax, descent, rows, interval, speed)
        axes[-1].set_xlabel("horizontal distance [m]")
        figure.colorbar(speed, ax=axes, label="speed [m/s]", shrink=0.9 if len(axes) == 1 else 0.6, aspect=24, pad=0.02)
        handles: list[Artist] = [
            Line2D([], [], color=INK, lw=1.0, label="path of the mass centre"),
            Line2D([], [], color=RED, marker="^", ls="", label="touchdown"),
            Line2D([], [], color=RED, lw=4.0, label="contact"),
            Line2D([], [], marker="o", mfc="none", mec=INK, ms=9, ls="", label=f"pose every {interval:g} s"),
        ]
        if whole and any(math.isfinite(descent.slope.length) for descent in descents):
            handles.append(Line2D([], [], color=INK, lw=1.2, ls=DASHES, label="finish"))
        figure.legend(handles=handles, loc="outside lower center", ncols=5, columnspacing=1.3, handletextpad=0.5)
    return figure


def plot_impact(descent: Descent, start: float = 0.0, stop: float = math.inf) -> Figure:
    """Plot forces, moment and kinetic energy over time: the paper's Fig. 7-10.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    start, stop : float
        Interval of time [s].

    Returns
    -------
    Figure
        Normal force, tangential force, total moment about the mass centre, kinetic energy.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If the trajectory is missing or has fewer than two rows in the interval.
    """
    rows = drawable_rows(descent)
    rows = rows[(rows["t"] >= start) & (rows["t"] <= stop)]
    if len(rows) < 2:
        raise ValueError(f"start = {start!r}, stop = {stop!r}: fewer than two rows of the trajectory lie in between")
    a, b = _arms(descent, rows)
    moment = -a * rows["normal"] + b * rows["tangential"] + rows["rolling"]
    translation, rotation = _kinetic(descent, rows)
    panels = (
        ("N [N]\nnormal force", rows["normal"], BLUE),
        ("F [N]\ntangential force", rows["tangential"], RED),
        ("moment [N m]\nabout the mass centre", moment, GREEN),
        ("T [J]\nkinetic energy", translation + rotation, INK),
    )
    brief = rows["t"][-1] - rows["t"][0] < 0.5
    scale, unit = (1e3, "ms") if brief else (1.0, "s")
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        for ax, (label, values, colour) in zip(grid.flat, panels, strict=True):
            _shade_contacts(ax, descent, scale)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(scale * rows["t"], values, color=colour)
            ax.set_ylabel(label)
            ax.set_xlim(scale * rows["t"][0], scale * rows["t"][-1])
        for ax in grid[1]:
            ax.set_xlabel(f"time [{unit}]")
        figure.align_ylabels(grid)
        figure.legend(handles=[_contact_key()], loc="outside lower center")
    return figure


def plot_descent(descent: Descent) -> Figure:
    """Plot velocities (the paper's Fig. 12-14) and the energy ledger of a descent over time.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.

    Returns
    -------
    Figure
        Velocity along the slope, velocity normal to it, angular velocity, and where the energy of the launch has gone:
        the layers add up to the same sum at all times.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If the trajectory is missing.
    """
    rows = drawable_rows(descent)
    t = rows["t"]
    layers = energy_layers(descent, rows)
    curves = (("u", "u [m/s]\nalong the slope"), ("v", "v [m/s]\nnormal to it"), ("omega", "ω [rad/s]\nspin"))
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 8.0), layout="constrained")
        axes: list[Axes] = list(figure.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.9)))
        for ax, (field, label) in zip(axes[:3], curves, strict=True):
            _shade_contacts(ax, descent, 1.0)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(t, rows[field], color=BLUE)
            ax.set_ylabel(label)
        colours = (BLUE, SKY, POTENTIAL, GREEN, RED, ORANGE, PURPLE)
        axes[3].stackplot(t, list(layers.values()), labels=list(layers), colors=colours, lw=0.0)
        axes[3].set_ylabel("energy [J]")
        axes[3].set_xlabel("time [s]")
        axes[3].set_xlim(t[0], t[-1] if t[-1] > t[0] else t[0] + 1.0)
        axes[0].set_title(_outcome(descent), loc="left")
        handles = [*axes[3].get_legend_handles_labels()[0], _contact_key()]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.align_ylabels(axes)
    return figure


def plot_worked_example(series: Mapping[str, np.ndarray], *, paper: tuple[float, float] | None = None) -> Figure:
    """Plot several computations of one impact over each other: the paper's Fig. 7-10.

    Parameters
    ----------
    series : mapping of str to structured ndarray
        Label to rows with the fields ``t`` [s], ``normal`` and ``tangential`` [N], ``moment`` [N m] about the mass
        centre and ``kinetic`` [J]. The first is drawn as a broad line, the others over it.
    paper : (float, float), optional
        Time [s] and kinetic energy [J] of a published value to mark.

    Returns
    -------
    Figure
        Normal force, tangential force, total moment about the mass centre, kinetic energy.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If ``series`` is empty.
    """
    if not series:
        raise ValueError("series is empty: there is nothing to draw")
    panels = (
        ("Fig. 7: normal force", "N [N]", "normal"),
        ("Fig. 8: tangential force", "F [N]", "tangential"),
        ("Fig. 9: moment about the mass centre", "moment [N m]", "moment"),
        ("Fig. 10: kinetic energy", "T [J]", "kinetic"),
    )
    styles: tuple[dict[str, Any], ...] = (
        {"color": SKY, "lw": 4.5},
        {"color": INK, "lw": 1.2, "ls": DASHES},
        {"color": RED, "lw": 1.4},
        {"color": PURPLE, "lw": 1.4},
    )
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 6.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        for ax, (title, label, field) in zip(grid.flat, panels, strict=True):
            ax.axhline(0.0, color=INK, lw=0.6)
            for i, (name, rows) in enumerate(series.items()):
                ax.plot(1e3 * rows["t"], rows[field], label=name, **styles[min(i, len(styles) - 1)])
            ax.set_title(title, loc="left")
            ax.set_ylabel(label)
        if paper is not None:
            grid[1, 1].plot(
                1e3 * paper[0], paper[1], color=ORANGE, marker="X", ms=9.0, ls="", label=f"paper: {paper[1]:g} J"
            )
        last = max(float(rows["t"][-1]) for rows in series.values())
        for ax in grid[1]:
            ax.set_xlim(0.0, 1.02e3 * last)
            ax.set_xlabel("time [ms]")
        figure.align_ylabels(grid)
        figure.legend(*grid[1, 1].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def plot_velocities(descent: Descent, *, note: str = "") -> Figure:
    """Plot the velocity of the mass centre in the world, not along the slope, and the spin: the paper's Fig. 12-14.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        Vertical velocity (upwards), horizontal velocity (in the sense of the descent) and angular velocity.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If the trajectory is missing.
    """
    rows = drawable_rows(descent)
    world = to_world(np.stack([rows["u"], rows["v"]], axis=-1), descent.slope.angle)
    panels = (
        ("Fig. 12: vertical velocity, upwards", "vertical [m/s]", world[:, 1]),
        ("Fig. 13: horizontal velocity, downhill", "horizontal [m/s]", world[:, 0]),
        ("Fig. 14: angular velocity, counter-clockwise", "ω [rad/s]", rows["omega"]),
    )
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 7.4), layout="constrained")
        axes: list[Axes] = list(figure.subplots(3, 1, sharex=True))
        for ax, (title, unit, values) in zip(axes, panels, strict=True):
            _shade_contacts(ax, descent, 1.0)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(rows["t"], values, color=BLUE)
            ax.set_title(title, loc="left")
            ax.set_ylabel(unit)
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(rows["t"][0], rows["t"][-1])
        figure.suptitle(note, x=0.01, ha="left", fontsize=10.0)
        figure.align_ylabels(axes)
        figure.legend(handles=[_contact_key()], loc="outside lower center")
    return figure


def plot_convergence(stiffness: np.ndarray, errors: Mapping[str, np.ndarray], *, note: str = "") -> Figure:
    """Plot how the compliant impact approaches the rigid one as the contact stiffens.

    Parameters
    ----------
    stiffness : ndarray, shape (n,)
        Of the contact [N/m].
    errors : mapping of str to ndarray, shape (n,)
        Distance of the velocities after the impact [m/s], by name of the case.
    note : str
        Written above the axes.

    Returns
    -------
    Figure
        With a line of slope -1/2 to compare with.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    """
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
        ax = figure.subplots()
        colours = (BLUE, RED, GREEN, PURPLE, ORANGE)
        for (name, error), colour, marker in zip(errors.items(), colours, "osD^v", strict=False):
            slope = np.polyfit(np.log(stiffness), np.log(error), 1)[0]
            ax.loglog(stiffness, error, marker=marker, color=colour, label=f"{name}: slope {slope:.3f}")
        most = max(float(error[0]) for error in errors.values())
        ax.loglog(stiffness, 3.0 * most * np.sqrt(stiffness[0] / stiffness), ls=DASHES, color=INK, label="slope -1/2")
        ax.set_xlabel("stiffness c [N/m]")
        ax.set_ylabel("distance from the rigid impact [m/s]")
        ax.set_title(note, loc="left")
        ax.legend()
    return figure


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
        The scenario that holds, as :func:`sledenv.wheel.collide_wheel` names it.
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
    with _matplotlib().rc_context(STYLE | {"hatch.linewidth": 0.8, "hatch.color": INK}):
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
        figure.suptitle(note, x=0.01, ha="left", fontsize=10.0)
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
        Tangential over normal speed of approach u/|v| [-], likewise.
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
    words = {mode: mode.name.lower().replace("_", "-") for mode in Mode}
    found = [words[mode] for mode in Mode if any((modes == mode).any() for modes in panels.values())]
    with _matplotlib().rc_context(STYLE):
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch
        from matplotlib.ticker import MultipleLocator

        figure = Figure(figsize=(WIDTH, 1.0 + 3.3 * len(panels)), layout="constrained")
        axes: list[Axes] = list(figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0])
        for ax, (title, modes) in zip(axes, panels.items(), strict=True):
            names = np.array(["", *words.values()])[modes]
            _draw_modes(ax, np.degrees(phi), speed_ratio, names, found, 0.85)
            ax.set_title(title, loc="left")
            ax.set_ylabel("$u/|v|$ at touch [-]")
            ax.xaxis.set_major_locator(MultipleLocator(45.0))
        axes[-1].set_xlabel("orientation $\\varphi$ at touch [deg]")
        figure.suptitle(note, x=0.01, ha="left", fontsize=10.0)
        handles = [Patch(color=_MODE_COLOURS[name], alpha=0.85, label=_MODE_WORDS[name]) for name in found]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5), columnspacing=1.2)
    return figure


def _matplotlib() -> ModuleType:
    try:
        import matplotlib
    except ImportError as error:
        raise ImportError('figures need matplotlib: pip install "sledenv[plot]"') from error
    return matplotlib


def _outcome(descent: Descent) -> str:
    jam = descent.jam
    return (
        f"{descent.status} after {descent.time:.2f} s, reward {float(jam.reward):.2f}, "
        f"jam index {float(jam.jam_index):.2f}"
    )


def _round_interval(interval: float) -> float:
    """Return the round number that is nearest to an interval, 1 for none."""
    if interval <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(interval))
    return min(
        (factor * power for factor in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0)), key=lambda nice: abs(nice - interval)
    )


def _box(descent: Descent, rows: np.ndarray, whole: bool) -> np.ndarray:
    """Return the lower left and the upper right corner [m] of what a strobe panel shows, world frame."""
    size = reach(descent.body)
    path = np.stack([rows["x"], rows["y"]], axis=-1)
    below = path * (1.0, 0.0)
    ends = [(0.0, 0.0), (descent.slope.length, 0.0)] if whole and math.isfinite(descent.slope.length) else path[:1]
    world = to_world(np.concatenate([path, below, ends]), descent.slope.angle)
    low, high = world.min(axis=0), world.max(axis=0)
    sides = max(1.1 * size, 0.02 * float(high[0] - low[0]))
    # Below the surface there is room for the marks of the contacts.
    return np.stack([low - (sides, 0.4 * size + 0.02 * (high[0] - low[0])), high + sides])


def _draw_slope(ax: Axes, descent: Descent) -> None:
    low, high = np.array(ax.get_xlim())
    steepness = math.tan(descent.slope.angle)
    surface = np.array([-low * steepness, -high * steepness])
    ax.fill_between([low, high], surface, ax.get_ylim()[0] - abs(high - low), color=GROUND, lw=0.0, zorder=0)
    ax.plot([low, high], surface, color=INK, lw=1.0, zorder=1)
    if math.isfinite(descent.slope.length):
        foot, top = to_world([(descent.slope.length, 0.0), (descent.slope.length, 1e3)], descent.slope.angle)
        ax.plot(*np.stack([foot, top], axis=-1), color=INK, lw=1.2, ls=DASHES, zorder=1, scalex=False, scaley=False)


def _draw_contacts(ax: Axes, descent: Descent) -> None:
    spans = contact_spans(descent)
    segments = np.stack([spans, np.zeros_like(spans)], axis=-1)
    world = to_world(segments, descent.slope.angle)
    for begin_end in world:
        ax.plot(*begin_end.T, color=RED, lw=4.0, solid_capstyle="butt", zorder=10)
    ax.plot(*world[:, 0].T, color=RED, marker=6, ms=7.0, ls="", zorder=10)  # 6: a triangle that points at its place


def _draw_poses(ax: Axes, descent: Descent, rows: np.ndarray, interval: float, speed: ScalarMappable) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    body, angle = descent.body, descent.slope.angle
    states = strobe_states(body, rows, interval)
    colours = speed.to_rgba(np.hypot(states[:, 3], states[:, 4]))
    places = states[:, :3].tolist()
    outlines = [to_world(body_outline(body, *place), angle) for place in places]
    heavy = [to_world(heavy_side(body, *place), angle) for place in places]
    spokes = [to_world([arc_centre(body, *place), place[:2]], angle) for place in places]
    ax.add_collection(PolyCollection(outlines, facecolors=colours, edgecolors="none", alpha=0.15, zorder=4))
    ax.add_collection(PolyCollection(heavy, facecolors=colours, edgecolors="none", alpha=0.45, zorder=5))
    ax.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colours, linewidths=1.3, zorder=6))
    ax.add_collection(LineCollection(spokes, colors=INK, linewidths=1.0, zorder=7))
    path = to_world(np.stack([rows["x"], rows["y"]], axis=-1), angle)
    ax.plot(*path.T, color=INK, lw=0.8, zorder=8)
    ax.plot(*to_world(states[:, :2], angle).T, color=INK, marker="o", ms=2.5, ls="", zorder=9)


def _shade_contacts(ax: Axes, descent: Descent, scale: float) -> None:
    """Shade the times of contact; ``scale`` is that of the time axis."""
    for rebound in descent.rebounds:
        end = scale * rebound["t"]
        ax.axvspan(end - scale * rebound["duration"], end, facecolor=SHADE, edgecolor=SHADE, lw=0.8, zorder=0)


def _contact_key() -> Artist:
    from matplotlib.patches import Patch

    return Patch(facecolor=SHADE, label="in contact")


def _arms(descent: Descent, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arms [m] of the touching feature in each row, zero in flight."""
    a, b = np.zeros(len(rows)), np.zeros(len(rows))
    for i in np.flatnonzero(rows["feature"]):
        a[i], b[i] = arms(descent.body, rows["feature"][i], rows["phi"][i])
    return a, b


def _kinetic(descent: Descent, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energy [J] of translation and of rotation in each row."""
    speed_squared = np.square(rows["u"]) + np.square(rows["v"])
    return 0.5 * descent.body.mass * speed_squared, 0.5 * descent.body.inertia * np.square(rows["omega"])


def energy_layers(descent: Descent, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Return where the energy [J] is in each row: moving, above the lowest place of the descent, stored or lost."""
    translation, rotation = _kinetic(descent, rows)
    height = to_world(np.stack([rows["x"], rows["y"]], axis=-1), descent.slope.angle)[:, 1]
    potential = descent.body.mass * descent.slope.gravity * (height - height.min())
    _, b = _arms(descent, rows)
    squeezed = np.where(rows["feature"] > 0, np.minimum(rows["y"] - b, 0.0), 0.0)
    stored = 0.5 * descent.law.stiffness * (1.0 + descent.law.asymmetry) * np.square(squeezed)
    hysteresis, sliding, rolling = _losses(descent, rows)
    return {
        "translation": translation,
        "rotation": rotation,
        "potential": potential,
        "stored in the contact": stored,
        "lost by hysteresis": hysteresis,
        "lost by sliding": sliding,
        "lost by rolling": rolling,
    }


def _losses(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Cumulative losses [J] by hysteresis, sliding and rolling, shape (3, m).

    The rebounds say how much each contact lost; the power of the contact forces says when. What had no force was lost
    in an impact of rigid surfaces, where the kinetic energy falls.
    """
    falls = -np.diff(sum(_kinetic(descent, rows)))
    a, b = _arms(descent, rows)
    power = np.stack(
        [
            rows["normal"] * np.maximum(rows["v"] - a * rows["omega"], 0.0),  # lost while the gap opens
            np.abs(rows["tangential"] * (rows["u"] + b * rows["omega"])),
            np.abs(rows["rolling"] * rows["omega"]),
        ]
    )
    work = np.diff(rows["t"]) * 0.5 * (power[:, 1:] + power[:, :-1])
    total = np.zeros(power.shape)
    for rebound in descent.rebounds:
        first = np.searchsorted(rows["t"], rebound["t"] - rebound["duration"])
        last = np.searchsorted(rows["t"], rebound["t"], side="right") - 1
        losses = np.array([rebound["loss_hysteresis"], rebound["loss_sliding"], rebound["loss_rolling"]])
        done = np.cumsum(work[:, first:last], axis=1)
        if done.size == 0:  # an impact whose rows were left out
            total[:, last + 1 :] += losses[:, None]
            continue
        struck = np.arange(done.shape[1]) >= np.argmax(falls[first:last])
        forced = done[:, -1:] > np.maximum(0.1 * losses[:, None], 0.0)
        spread = np.divide(done, done[:, -1:], out=np.tile(1.0 * struck, (3, 1)), where=forced)
        total[:, first + 1 : last + 1] += losses[:, None] * spread
        total[:, last + 1 :] += losses[:, None]
    return total


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
    # To the outer edges of the cells.
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
