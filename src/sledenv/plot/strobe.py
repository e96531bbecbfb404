"""The motion of a body as strobe pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from sledenv.plot.grounds import LINE, bands, below, in_sight, surface
from sledenv.plot.riders import HELMET, SLEEVE, SUIT, TROUSERS, pieces, pose_times, strobe_poses
from sledenv.plot.shapes import body_outline, contact_paths, heavy_side, placed, spoke, to_world
from sledenv.plot.style import BLUE, DASHES, GREEN, GROUND, INK, ORANGE, RED, WIDTH, outcome, plain, styled
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.sleds import FRAME, LEGS, RIDER, RUNNER

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

_PARTS: Final = {RUNNER: BLUE, FRAME: GREEN, LEGS: ORANGE, RIDER: RED}  # where each part of a sled touched
_ALPHAS: Final = {SUIT: 0.75, TROUSERS: 0.5, SLEEVE: 0.35, HELMET: 1.0}  # of pieces in the colour of the speed
_WIDE, _HIGH = 8.0, 4.5  # inches of a panel, at most
_LONG: Final = 100.0  # sizes of the body, from which on heights of a picture are exaggerated,
_SEEN: Final = 0.03  # so that the size upwards is this part of the width
_BAND, _LETTERS = 0.014, 0.013  # depth of a zone and height of its words, of the width of the picture


def plot_strobe(
    descents: Descent | Sequence[Descent],
    *,
    labels: Sequence[str] | None = None,
    frames: int = 14,
    whole: bool = True,
    between: tuple[float, float] | None = None,
) -> Figure:
    """Draw descents as strobe pictures, one panel each, all to one scale.

    The ground is as it is, its profile with it. Heights of a picture more than 100 bodies long are exaggerated, as its
    axis says: contacts would hide the body. The sled is drawn at equal intervals of time, the same in all panels,
    coloured by its speed; its darker half holds the mass centre of a segment, and of any other body is the one that
    is down at phi = 0. A sled with its rider shows both, and the marks of its touchdowns which part it was. A zone of
    the slope is a band below the surface, darker than the others if its friction is higher, light blue if it is lower
    than that around it.

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
    between : pair of float, optional
        Show only what is between these places along the slope [m].

    Returns
    -------
    Figure

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there is no descent, one has no trajectory or none of it ``between``, ``frames`` < 2 or the number of labels
        differs.
    """
    descents = [descents] if isinstance(descents, Descent) else list(descents)
    if not descents:
        raise ValueError("descents is empty: there is nothing to draw")
    if labels is not None and len(labels) != len(descents):
        raise ValueError(f"{len(labels)} labels for {len(descents)} descents")
    if frames < 2:
        raise ValueError(f"frames = {frames!r}: must be >= 2")
    with styled():
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D

        tracks = [drawable_rows(descent) for descent in descents]
        ends = [float(rows["t"][-1]) for rows in tracks]
        interval = _round_interval(max(min(ends), max(ends) / 3.0) / (frames - 1))
        interval = _round_interval(max(map(partial(_usual_interval, interval), descents, tracks)))
        fastest = max(float(np.hypot(rows["u"], rows["v"]).max()) for rows in tracks)
        speed = ScalarMappable(Normalize(0.0, fastest if fastest > 0.0 else 1.0), "viridis")
        extents = [_extent(descent, rows, whole, between) for descent, rows in zip(descents, tracks, strict=True)]
        tall = _exaggeration(extents, min(descent.body.size for descent in descents))
        boxes = [_box(descent, extent, tall) for descent, extent in zip(descents, extents, strict=True)]
        low = min(box[0, 0] for box in boxes)
        high = max(box[1, 0] for box in boxes)
        heights = [float(np.clip(_WIDE * tall * np.ptp(box[:, 1]) / (high - low), 1.0, _HIGH)) for box in boxes]
        figure = Figure(figsize=(WIDTH, sum(heights) + 0.35 * len(descents) + 1.0), layout="constrained")
        grid = figure.subplots(len(descents), 1, sharex=True, squeeze=False, height_ratios=heights)
        axes: list[Axes] = list(grid[:, 0])
        for i, (ax, descent, rows, box) in enumerate(zip(axes, descents, tracks, boxes, strict=True)):
            ax.set_xlim(low, high)
            ax.set_ylim(box[0, 1], box[1, 1])
            ax.set_aspect(tall)
            ax.set_ylabel("height [m]" if tall == 1.0 else f"height [m]\nvertical exaggeration {tall:g}")
            ax.set_title(outcome(descent) if labels is None else f"{plain(labels[i])}: {outcome(descent)}", loc="left")
            _draw_slope(ax, descent)
            _draw_zones(ax, descent, tall)
            _draw_contacts(ax, descent)
            _draw_poses(ax, descent, rows, interval, speed)
        axes[-1].set_xlabel("horizontal distance [m]")
        figure.colorbar(speed, ax=axes, label="speed [m/s]", shrink=0.9 if len(axes) == 1 else 0.6, aspect=24, pad=0.02)
        handles: list[Artist] = [
            Line2D([], [], color=INK, lw=1.0, label="path of the mass centre"),
            *_touchdown_keys(descents),
            Line2D([], [], color=RED, lw=4.0, label="contact"),
            Line2D([], [], marker="o", mfc="none", mec=INK, ms=9, ls="", label=f"pose every {interval:g} s"),
        ]
        if whole and any(math.isfinite(descent.slope.length) for descent in descents):
            handles.append(Line2D([], [], color=INK, lw=1.2, ls=DASHES, label="finish"))
        figure.legend(handles=handles, loc="outside lower center", ncols=5, columnspacing=1.3, handletextpad=0.5)
    return figure


def _usual_interval(interval: float, descent: Descent, rows: np.ndarray) -> float:
    """Return the median time [s] between poses of a descent, of which an interval may leave out most."""
    times = pose_times(descent.body, rows, interval)[:-1]  # the last one is the end
    return float(np.median(np.diff(times))) if len(times) > 1 else interval


def _round_interval(interval: float) -> float:
    """Return the round number that is nearest to an interval, 1 for none."""
    if interval <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(interval))
    return min(
        (factor * power for factor in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0)), key=lambda nice: abs(nice - interval)
    )


def _extent(descent: Descent, rows: np.ndarray, whole: bool, between: tuple[float, float] | None) -> np.ndarray:
    """Return the lowest and the highest places [m] of the mass centre and of the ground under it, world frame."""
    slope, path = descent.slope, np.stack([rows["x"], rows["y"]], axis=-1)
    ends = [0.0, slope.length] if whole and math.isfinite(slope.length) else []
    if between is not None:
        ends, path = list(between), path[(between[0] <= path[:, 0]) & (path[:, 0] <= between[1])]
        if not len(path):
            raise ValueError(f"between = {between!r}: a descent has nothing there")
    places = [*path[:, 0].tolist(), *ends]
    ground = surface(slope.vertices, min(places), max(places))
    world = to_world(np.concatenate([path, ground]), slope.angle)
    return np.stack([world.min(axis=0), world.max(axis=0)])


def _exaggeration(extents: Sequence[np.ndarray], size: float) -> float:
    """Return how many times as long a metre upwards is to be as one along, so that contacts do not hide bodies.

    Parameters
    ----------
    extents : sequence of ndarray
        Those of the panels, which have one scale.
    size : float
        Of the smallest body [m].
    """
    across = max(float(np.ptp(extent[:, 0])) for extent in extents)
    upwards = max(float(np.ptp(extent[:, 1])) for extent in extents) + 2.0 * size
    wanted = _SEEN * across / size if across > _LONG * size and size > 0.0 else 1.0  # a point has no size
    fitting = [tall for tall in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if tall * upwards <= across * _HIGH / _WIDE]
    return next((tall for tall in fitting if tall >= wanted), max(fitting, default=1.0))


def _box(descent: Descent, extent: np.ndarray, tall: float) -> np.ndarray:
    """Return the lower left and the upper right corner [m] of what a strobe panel shows, world frame."""
    (low, high), size = extent, descent.body.size
    wide = float(high[0] - low[0])
    sides = np.maximum(1.1 * size, np.array([0.02, 0.02 / tall]) * wide)
    # Below the surface there is room for the marks of the contacts, and for the words of zones.
    below_it = 0.05 if descent.slope.zones else 0.02
    return np.stack([low - (sides[0], 0.4 * size + below_it / tall * wide), high + sides])


def _seen(ax: Axes, descent: Descent) -> np.ndarray:
    """Return the line of the ground [m] through a panel, and beyond its edges, slope frame."""
    corners = np.stack(np.meshgrid(ax.get_xlim(), ax.get_ylim()), axis=-1).reshape(-1, 2)
    x = to_world(corners, -descent.slope.angle)[:, 0]
    return surface(descent.slope.vertices, float(x.min()), float(x.max()))


def _draw_slope(ax: Axes, descent: Descent) -> None:
    from matplotlib.collections import PolyCollection

    slope, line = descent.slope, _seen(ax, descent)
    deep = np.array([0.0, np.ptp(ax.get_xlim()) + np.ptp(ax.get_ylim()) + np.ptp(line[:, 1])])
    ground = to_world(np.concatenate([line, line[[-1, 0]] - deep]), slope.angle)
    ax.add_collection(PolyCollection([ground], facecolors=GROUND, edgecolors="none", zorder=0))
    ax.plot(*to_world(line, slope.angle).T, color=INK, lw=1.0, zorder=1)
    if math.isfinite(slope.length):
        base = float(slope.height_at(slope.length))
        post = [(slope.length, base), (slope.length, base + 1e3)]
        ax.plot(*to_world(post, slope.angle).T, color=INK, lw=1.2, ls=DASHES, zorder=1)


def _draw_zones(ax: Axes, descent: Descent, tall: float) -> None:
    slope, line = descent.slope, _seen(ax, descent)
    low, high = np.stack([ax.get_xlim(), ax.get_ylim()], axis=-1)
    wide = float(high[0] - low[0])
    depth, letter = _BAND * wide / tall, 0.55 * _LETTERS * wide
    shown = in_sight(line, to_world(line, slope.angle), low, high)
    for band in bands(slope, descent.law.friction, *shown):
        corners = to_world(band.outline(line, depth), slope.angle)
        ax.fill(*corners.T, facecolor=band.colour, edgecolor=LINE, lw=0.6, zorder=0.5)
        before_finish = max(min(band.end, slope.length), band.begin)
        middle, said = 0.5 * (band.begin + before_finish), band.label((before_finish - band.begin) / letter)
        if not said:
            continue
        half = 0.5 * letter * len(said) + depth
        over = surface(line, middle - half, middle + half)
        under = float(below(over, depth)[:, 1].min())
        x, y = to_world((middle, under - 0.9 * _LETTERS * wide / tall), slope.angle)
        turn: dict[str, Any] = {
            "rotation": -math.degrees(math.atan2(tall * math.sin(slope.angle), math.cos(slope.angle))),
            "rotation_mode": "anchor",
            "ha": "center",
            "va": "center",
        }
        ax.text(x, y, said, fontsize=8.5, color=INK, clip_on=True, zorder=3, **turn)


def _touchdown_keys(descents: Sequence[Descent]) -> list[Artist]:
    """Entries of the legend for the marks of touchdowns: one of a colour."""
    from matplotlib.lines import Line2D

    found: dict[str, str] = {}
    for descent in descents:
        for colour, _, part in _touchdowns(descent):
            found.setdefault(f"touchdown, {part}" if part else "touchdown", colour)
    return [Line2D([], [], color=colour, marker="^", ls="", label=said) for said, colour in found.items()]


def _touchdowns(descent: Descent) -> list[tuple[str, np.ndarray, str]]:
    """Colour, rows of the rebounds and part of the body for each colour of marks: parts of a sled with its rider."""
    features = descent.rebounds["feature"]
    if not pieces(descent.body):
        return [(RED, np.full(len(features), True), "")]
    named = [(_PARTS[part], features == code, part) for code, part in enumerate(descent.body.parts, 1)]
    return [(colour, rows, part) for colour, rows, part in named if rows.any()]


def _draw_contacts(ax: Axes, descent: Descent) -> None:
    paths = [to_world(path, descent.slope.angle) for path in contact_paths(descent)]
    for path in paths:
        ax.plot(*path.T, color=RED, lw=4.0, solid_capstyle="butt", zorder=10)
    for colour, rows, _ in _touchdowns(descent):  # 6: a triangle that points at its place
        begins = np.array([path[0] for path, marked in zip(paths, rows, strict=True) if marked])
        ax.plot(*begins.reshape(-1, 2).T, color=colour, marker=6, ms=7.0, ls="", zorder=10)


def _draw_poses(ax: Axes, descent: Descent, rows: np.ndarray, interval: float, speed: ScalarMappable) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    body, angle = descent.body, descent.slope.angle
    states = strobe_poses(body, rows, interval)
    colours = speed.to_rgba(np.hypot(states[:, 3], states[:, 4]))
    places = states[:, :3].tolist()
    outlines = [to_world(body_outline(body, *place), angle) for place in places]
    spokes = [to_world(spoke(body, *place), angle) for place in places]
    ax.add_collection(PolyCollection(outlines, facecolors=colours, edgecolors="none", alpha=0.15, zorder=4))
    if pieces(body):
        _draw_riders(ax, descent, states, colours)
    else:
        heavy = [to_world(heavy_side(body, *place), angle) for place in places]
        ax.add_collection(PolyCollection(heavy, facecolors=colours, edgecolors="none", alpha=0.45, zorder=5))
    width = 0.7 if pieces(body) else 1.3
    ax.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colours, linewidths=width, zorder=6))
    ax.add_collection(LineCollection(spokes, colors=INK, linewidths=1.0, zorder=7))
    path = to_world(np.stack([rows["x"], rows["y"]], axis=-1), angle)
    ax.plot(*path.T, color=INK, lw=0.8, zorder=8)
    ax.plot(*to_world(states[:, :2], angle).T, color=INK, marker="o", ms=2.5, ls="", zorder=9)


def _draw_riders(ax: Axes, descent: Descent, states: np.ndarray, colours: np.ndarray) -> None:
    """Draw the sled and its rider in each pose: the rider in the colour of the speed, what is steel or leather dark."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgba

    for place, colour in zip(states[:, :3].tolist(), colours, strict=True):
        drawn, faces = [], []
        for piece in pieces(descent.body):
            drawn.append(to_world(placed(piece.points, *place), descent.slope.angle))
            alpha = _ALPHAS.get(piece.colour)
            faces.append(to_rgba(piece.colour, 0.9) if alpha is None else (*colour[:3], alpha))
        ax.add_collection(PolyCollection(drawn, facecolors=faces, edgecolors=INK, linewidths=0.35, zorder=5))
