"""The motion of a body as strobe pictures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from sledenv.plot.grounds import LINE, bands, below, in_sight, surface
from sledenv.plot.riders import HELMET, SLEEVE, SUIT, TROUSERS, pieces, pose_times, strobe_poses
from sledenv.plot.shapes import body_outline, contact_paths, heavy_side, placed, spoke, to_world
from sledenv.plot.style import BLUE, DASHES, GREEN, GROUND, INK, ORANGE, RED, WIDTH, outcome, styled
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import FINITE, checked, checked_count, checked_pair, checked_sequence
from sledenv.simulation.sleds import FRAME, LEGS, RIDER, RUNNER

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

_PARTS: Final = {RUNNER: BLUE, FRAME: GREEN, LEGS: ORANGE, RIDER: RED}  # where each part of a sled touched
_ALPHAS: Final = {SUIT: 0.75, TROUSERS: 0.5, SLEEVE: 0.35, HELMET: 1.0}  # of pieces in the colour of the speed
_WIDE, _HIGH = 8.0, 4.5  # inches of a row, at most
_SHORT, _LONG = 24.0, 60.0  # sizes of the body, twelve and thirty sleds: how long a row should and may be
_MOST_ROWS: Final = 8  # of a descent, as long as they may be longer
_STEEP: Final = 0.25  # height of a picture over its width, from which on rows would be as high as it is
_ENDLESS: Final = 1e6  # sizes of the body, from which on there is nothing to see of it
_ON_THE_GROUND: Final = 500  # points of the ground in a row
_BAND, _LETTERS = 0.014, 0.013  # depth of a zone and height of its words, of the width of the picture


class _Panel(NamedTuple):
    """A row of a picture: a descent, and what of it is shown."""

    descent: Descent
    rows: np.ndarray  # of the trajectory
    low: np.ndarray  # [m] lower left corner, world frame
    high: np.ndarray  # [m] upper right corner
    title: str  # empty where a descent goes on

    @property
    def wide(self) -> float:
        """Its width [m]."""
        return float(self.high[0] - self.low[0])

    @property
    def line(self) -> np.ndarray:
        """The line of the ground [m] through the panel, and beyond its edges, slope frame."""
        corners = np.array([(x, y) for x in (self.low[0], self.high[0]) for y in (self.low[1], self.high[1])])
        x = to_world(corners, -self.descent.slope.angle)[:, 0]
        return surface(self.descent.slope.vertices, float(x.min()), float(x.max()))

    @property
    def shows_the_finish(self) -> bool:
        """Whether the place where the slope ends is in it."""
        slope = self.descent.slope
        if not math.isfinite(slope.length):
            return False
        x = to_world((slope.length, float(slope.height_at(slope.length))), slope.angle)[0]
        return bool(self.low[0] <= x <= self.high[0])


def plot_strobe(
    descents: Descent | Sequence[Descent],
    *,
    labels: Sequence[str] | None = None,
    frames: int = 14,
    between: tuple[float, float] | None = None,
) -> Figure:
    """Draw descents as strobe pictures, all to one scale; one much longer than the body is cut into rows.

    The ground is as it is, its profile with it. The sled is drawn at equal intervals of time, the same in all panels,
    coloured by its speed; its darker half holds the mass centre of a segment, and of any other body is the one that is
    down at phi = 0. A sled with its rider shows both, and the marks of its touchdowns which part it was. A zone of the
    slope is a band below the surface, darker than the others if its friction is higher, light blue if it is lower than
    that around it.

    Parameters
    ----------
    descents : Descent or sequence of Descent
        Simulated with ``record="trajectory"``.
    labels : sequence of str, optional
        One per descent, put in front of its title.
    frames : int
        About this many poses in a row of the shortest descent, >= 2; poses that would lie on top of each other are left
        out.
    between : pair of float, optional
        Show only what is between these places along the slope [m], in one row of up to thirty bodies.

    Returns
    -------
    Figure

    Raises
    ------
    TypeError, ValueError
        If an argument is of another kind, there is no descent, one has no trajectory or none of it ``between``,
        ``frames`` < 2 or the number of labels differs.
    """
    descents = [descents] if isinstance(descents, Descent) else checked_sequence("descents", descents, Descent)
    if not descents:
        raise ValueError("descents is empty: there is nothing to draw")
    labels = [""] * len(descents) if labels is None else checked_sequence("labels", labels, str)
    if len(labels) != len(descents):
        raise ValueError(f"{len(labels)} labels for {len(descents)} descents")
    checked_count("frames", frames, least=2)
    if between is not None:
        begin, end = checked_pair("between", between)
        between = checked("between", "begin", begin, FINITE), checked("between", "end", end, FINITE)
    with styled():
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.figure import Figure

        tracks = [drawable_rows(descent) for descent in descents]
        fastest = max(float(np.hypot(rows["u"], rows["v"]).max()) for rows in tracks)
        speed = ScalarMappable(Normalize(0.0, fastest if fastest > 0.0 else 1.0), "viridis")
        panels = _panels(descents, tracks, labels, between)
        interval = _interval(descents, tracks, max(2, frames * len(panels) // len(descents)))
        heights = [float(np.clip(_WIDE * (p.high - p.low)[1] / p.wide, 0.5, _HIGH)) for p in panels]
        figure = Figure(figsize=(WIDTH, sum(heights) + 0.35 * len(panels) + 1.0), layout="constrained")
        axes: list[Axes] = list(figure.subplots(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0])
        for ax, panel in zip(axes, panels, strict=True):
            ax.set(xlim=(panel.low[0], panel.high[0]), ylim=(panel.low[1], panel.high[1]), aspect="equal")
            ax.set_ylabel("height [m]")
            ax.set_title(panel.title, loc="left")
            _draw_slope(ax, panel)
            _draw_zones(ax, panel)
            _draw_contacts(ax, panel.descent)
            _draw_poses(ax, panel, interval, speed)
        axes[-1].set_xlabel("horizontal distance [m]")
        figure.align_ylabels(axes)
        figure.colorbar(speed, ax=axes, label="speed [m/s]", shrink=0.9 if len(axes) == 1 else 0.6, aspect=24, pad=0.02)
        figure.legend(
            handles=_keys(panels, interval), loc="outside lower center", ncols=4, columnspacing=1.3, handletextpad=0.5
        )
    return figure


def _panels(
    descents: Sequence[Descent],
    tracks: Sequence[np.ndarray],
    labels: Sequence[str],
    between: tuple[float, float] | None,
) -> list[_Panel]:
    """Return the rows of a picture, of as many metres each."""
    shown = [_shown(descent, rows, between) for descent, rows in zip(descents, tracks, strict=True)]
    every = np.concatenate([points for both in shown for points in both])
    wide, high = np.ptp(every, axis=0).tolist()
    side = max(1.1 * max(descent.body.size for descent in descents), 0.02 * wide)
    begin, end = every[:, 0].min() - side, every[:, 0].max() + side
    smallest = max(min(descent.body.size for descent in descents), 1e-9)
    count = 1 if high > _STEEP * wide else _count((end - begin) / smallest, _SHORT if between is None else _LONG)
    edges = np.linspace(begin, end, count + 1)
    panels = []
    for descent, rows, label, (path, ground) in zip(descents, tracks, labels, shown, strict=True):
        title = outcome(descent, label)
        for left, right in itertools.pairwise(edges.tolist()):
            inside = path[(left <= path[:, 0]) & (path[:, 0] <= right), 1]
            if len(inside) == 0:  # it has not come here
                continue
            under, size = np.interp(np.linspace(left, right, _ON_THE_GROUND), *ground.T), descent.body.size
            below_it = (0.05 if descent.slope.zones else 0.02) * (right - left)  # for marks, and for words of zones
            low = min(inside.min(), under.min()) - 0.4 * size - below_it
            top = max(inside.max(), under.max()) + max(1.1 * size, 0.02 * (right - left))
            panels.append(_Panel(descent, rows, np.array([left, low]), np.array([right, top]), title))
            title = ""
    return panels


def _count(sizes: float, usual: float) -> int:
    """Return how many rows there should be of a picture so many sizes of the body long, of a usual length likewise."""
    if not sizes < _ENDLESS:
        return 1
    return max(min(math.ceil(sizes / usual), _MOST_ROWS), math.ceil(sizes / _LONG))


def _shown(descent: Descent, rows: np.ndarray, between: tuple[float, float] | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the path of the mass centre and the ground below it, up to the finish, as points [m] of the world."""
    slope, path = descent.slope, np.stack([rows["x"], rows["y"]], axis=-1)
    ends = [0.0, slope.length] if math.isfinite(slope.length) else []
    if between is not None:
        ends, path = list(between), path[(between[0] <= path[:, 0]) & (path[:, 0] <= between[1])]
        if not len(path):
            raise ValueError(f"between = {between!r}: a descent has nothing there")
    places = [*path[:, 0].tolist(), *ends]
    return to_world(path, slope.angle), to_world(surface(slope.vertices, min(places), max(places)), slope.angle)


def _interval(descents: Sequence[Descent], tracks: Sequence[np.ndarray], poses: int) -> float:
    """Return the time [s] between two poses, a round number, so that the shortest descent has about so many."""
    ends = [float(rows["t"][-1]) for rows in tracks]
    interval = _rounded(max(min(ends), max(ends) / 3.0) / (poses - 1))
    usual = [interval]
    for descent, rows in zip(descents, tracks, strict=True):  # most of the poses may be left out
        times = pose_times(descent.body, rows, interval)[:-1]  # the last one is the end
        usual += [float(np.median(np.diff(times)))] if len(times) > 1 else []
    return _rounded(max(usual))


def _rounded(interval: float) -> float:
    """Return the round number that is nearest to an interval, 1 for none."""
    if interval <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(interval))
    return min((factor * power for factor in (1, 1.5, 2, 3, 4, 5, 7.5, 10)), key=lambda nice: abs(nice - interval))


def _draw_slope(ax: Axes, panel: _Panel) -> None:
    from matplotlib.collections import PolyCollection

    slope, line = panel.descent.slope, panel.line
    deep = np.array([0.0, np.sum(panel.high - panel.low) + np.ptp(line[:, 1])])
    ground = to_world(np.concatenate([line, line[[-1, 0]] - deep]), slope.angle)
    ax.add_collection(PolyCollection([ground], facecolors=GROUND, edgecolors="none", zorder=0))
    ax.plot(*to_world(line, slope.angle).T, color=INK, lw=1.0, zorder=1)
    if math.isfinite(slope.length):
        base = float(slope.height_at(slope.length))
        post = [(slope.length, base), (slope.length, base + 1e3)]
        ax.plot(*to_world(post, slope.angle).T, color=INK, lw=1.2, ls=DASHES, zorder=1)


def _draw_zones(ax: Axes, panel: _Panel) -> None:
    descent, slope, line, wide = panel.descent, panel.descent.slope, panel.line, panel.wide
    depth, letter = _BAND * wide, 0.55 * _LETTERS * wide
    shown = in_sight(line, to_world(line, slope.angle), panel.low, panel.high)
    for band in bands(slope, descent.law.friction, *shown):
        corners = to_world(band.outline(line, depth), slope.angle)
        ax.fill(*corners.T, facecolor=band.colour, edgecolor=LINE, lw=0.6, zorder=0.5)
        before_finish = max(min(band.end, slope.length), band.begin)
        middle, said = 0.5 * (band.begin + before_finish), band.label((before_finish - band.begin) / letter)
        if not said:
            continue
        half = 0.5 * letter * len(said) + depth
        under = float(below(surface(line, middle - half, middle + half), depth)[:, 1].min())
        x, y = to_world((middle, under - 0.9 * _LETTERS * wide), slope.angle)
        style: dict[str, Any] = {"rotation": -math.degrees(slope.angle), "rotation_mode": "anchor", "fontsize": 8.5}
        ax.text(x, y, said, color=INK, clip_on=True, zorder=3, ha="center", va="center", **style)


def _keys(panels: Sequence[_Panel], interval: float) -> list[Artist]:
    """Entries of the legend."""
    from matplotlib.lines import Line2D

    marks = {said: colour for panel in panels for colour, _, said in _touchdowns(panel.descent)}
    keys: list[Artist] = [
        Line2D([], [], color=INK, lw=1.0, label="path of the mass centre"),
        *(Line2D([], [], color=colour, marker="^", ls="", label=said) for said, colour in marks.items()),
        Line2D([], [], color=RED, lw=4.0, label="contact"),
        Line2D([], [], marker="o", mfc="none", mec=INK, ms=9, ls="", label=f"pose every {interval:g} s"),
    ]
    if any(panel.shows_the_finish for panel in panels):
        keys.append(Line2D([], [], color=INK, lw=1.2, ls=DASHES, label="finish"))
    return keys


def _touchdowns(descent: Descent) -> list[tuple[str, np.ndarray, str]]:
    """Colour, rows of the rebounds and words of each kind of marks: one, or of a sled with its rider one of a part."""
    features = descent.rebounds["feature"]
    if not pieces(descent.body):
        return [(RED, np.full(len(features), True), "touchdown")]
    named = [(_PARTS[part], features == k, f"touchdown, {part}") for k, part in enumerate(descent.body.parts, 1)]
    return [(colour, rows, said) for colour, rows, said in named if rows.any()]


def _draw_contacts(ax: Axes, descent: Descent) -> None:
    paths = [to_world(path, descent.slope.angle) for path in contact_paths(descent)]
    for path in paths:
        ax.plot(*path.T, color=RED, lw=4.0, solid_capstyle="butt", zorder=10)
    for colour, rows, _ in _touchdowns(descent):  # 6: a triangle that points at its place
        begins = np.array([path[0] for path, marked in zip(paths, rows, strict=True) if marked])
        ax.plot(*begins.reshape(-1, 2).T, color=colour, marker=6, ms=7.0, ls="", zorder=10)


def _draw_poses(ax: Axes, panel: _Panel, interval: float, speed: ScalarMappable) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    descent, body, angle = panel.descent, panel.descent.body, panel.descent.slope.angle
    states = strobe_poses(body, panel.rows, interval)
    x = to_world(states[:, :2], angle)[:, 0]
    states = states[(panel.low[0] - body.size <= x) & (x <= panel.high[0] + body.size)]
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
    path = to_world(np.stack([panel.rows["x"], panel.rows["y"]], axis=-1), angle)
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
