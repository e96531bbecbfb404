"""The picture that a page shows before its scripts run: the poses of a descent over its ground."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from sledenv.pages.scenes import drawn_body
from sledenv.plot.grounds import surface
from sledenv.plot.riders import strobe_poses
from sledenv.plot.shapes import to_world
from sledenv.simulation.bodies import Body
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent

_WIDTH: Final = 1160.0
_LOWEST, _HIGHEST = 230.0, 470.0
_POSES: Final = 14
_POINTS: Final = 600  # of the path


class Still(NamedTuple):
    """An SVG, in the colours of templates/play.css."""

    box: str  # its viewBox
    content: str


def still(descent: Descent) -> Still:
    """Return the picture of a descent.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.

    Raises
    ------
    ValueError
        If it has no trajectory.
    """
    rows, slope, size = drawable_rows(descent), descent.slope, max(descent.body.size, 1e-6)
    path = np.stack([rows["x"], rows["y"]], axis=-1)[:: math.ceil(len(rows) / _POINTS)]
    finish = [slope.length] if math.isfinite(slope.length) else []
    left, right = min(0.0, float(path[:, 0].min())), max(*finish, float(path[:, 0].max()), 0.0)
    ground = surface(slope.vertices, left, right)
    world = to_world(np.concatenate([path, ground, ground + np.array([0.0, 2.0 * size])]), slope.angle)
    low, high = world.min(axis=0), world.max(axis=0)
    margin = max(1.3 * size, 0.03 * float(high[0] - low[0]))
    wide, tall = high - low + 2.0 * margin
    scale = min(_WIDTH / wide, _HIGHEST / tall, 90.0 / size)
    height = float(np.clip(tall * scale, _LOWEST, _HIGHEST))

    def pixels(points: np.ndarray) -> np.ndarray:
        apart = to_world(points, slope.angle) - 0.5 * (low + high)
        placed: np.ndarray = apart * (scale, -scale) + (0.5 * _WIDTH, 0.5 * height)
        return placed

    reach = 2.0 * (_WIDTH + height) / scale  # beyond the edges of the picture
    top = pixels(surface(slope.vertices, left - reach, right + reach))
    below = pixels(np.array([(right + reach, -reach), (left - reach, -reach)]))
    parts = [
        f'<rect width="{_WIDTH:g}" height="{height:.0f}" fill="var(--sky)"/>',
        f'<polygon points="{_text(top)} {_text(below)}" fill="var(--ground)"/>',
        f'<polyline points="{_text(top)}" fill="none" stroke="var(--line)" stroke-width="2"/>',
    ]
    for x in finish:
        foot = np.array([(x, float(slope.height_at(x)))])
        line = _text(pixels(np.concatenate([foot, foot + np.array([0.0, 4.0 * size])])))
        parts.append(f'<polyline points="{line}" stroke="var(--ink)" stroke-width="4" stroke-dasharray="12 9"/>')
    poses = strobe_poses(descent.body, rows, max(float(rows["t"][-1]), 1e-3) / _POSES)
    parts.append(f"<defs>{_pose(descent.body)}</defs>")
    for (column, row), phi in zip(pixels(poses[:, :2]).tolist(), poses[:, 2].tolist(), strict=True):
        turn = math.degrees(phi - slope.angle)
        place = f"translate({column:.1f} {row:.1f}) scale({scale:.4g} {-scale:.4g}) rotate({turn:.2f})"
        parts.append(f'<use href="#drawn" transform="{place}"/>')
    parts.append(f'<polyline points="{_text(pixels(path))}" fill="none" stroke="var(--blue)" stroke-width="1.3"/>')
    return Still(f"0 0 {_WIDTH:g} {height:.0f}", "".join(parts))


def _pose(body: Body) -> str:
    """The body in metres, at its mass centre."""
    drawn = drawn_body(body)
    line = 'stroke-linejoin="round" vector-effect="non-scaling-stroke"'
    layers = [(drawn["outline"], drawn.get("hull", "#f6c7a3"))]
    layers += [(piece["points"], piece["colour"]) for piece in drawn.get("pieces", [])] or [(drawn["heavy"], "#d55e00")]
    polygons = "".join(
        f'<polygon points="{_text(points, 3)}" fill="{colour}" stroke="#2d343c" stroke-width="0.5" {line}/>'
        for points, colour in layers
    )
    return f'<g id="drawn">{polygons}</g>'


def _text(points: np.ndarray, digits: int = 1) -> str:
    return " ".join(f"{x:.{digits}f},{y:.{digits}f}" for x, y in points.tolist())
