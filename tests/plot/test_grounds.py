"""Zones of a slope in pictures: where they are, how dark, and what is written below them."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon

from sledenv import plot
from sledenv.plot.grounds import bands, surface
from sledenv.plot.shapes import to_world
from sledenv.simulation.scene import Slope, Zone
from tests.bodies import DISC, HILL, ICE, run

ZONED = Slope(0.15, 10.0, zones=(Zone(2.0, 4.0, 0.01, 0.0), Zone(4.0, 4.1, 0.2, 0.0), Zone(6.0, math.inf, 0.6, 0.02)))
LAUNCH = (0.0, 0.5, 0.2, 3.0, 0.0, 0.5)


def test_bands_are_the_zones_in_sight() -> None:
    """Oracle: the zones of the slope."""
    assert [(band.begin, band.end) for band in bands(ZONED, 0.05)] == [zone[:2] for zone in ZONED.zones]
    assert [(band.begin, band.end) for band in bands(ZONED, 0.05, 3.0, 7.0)] == [(3.0, 4.0), (4.0, 4.1), (6.0, 7.0)]
    assert bands(ZONED, 0.05, 4.5, 5.5) == bands(ZONED, 0.05, 9.0, 1.0) == bands(HILL, 0.05) == []


@pytest.mark.parametrize("radius", [0.2, 5.0, 100.0])
def test_a_bend_is_drawn_a_millimetre_off_at_most(radius: float) -> None:
    """Oracle: the heights that the kernel tells, at many places between."""
    slope = Slope(0.2, 200.0, profile=[(40.0, 0.0), (80.0, 20.0), (120.0, 0.0)], rounding=radius)
    line, x = surface(slope.vertices, 30.0, 130.0), np.linspace(30.0, 130.0, 20_001)
    steepest = math.atan2(20.0, 40.0)  # where a millimetre is more along y
    assert np.abs(np.interp(x, *line.T) - slope.height_at(x)).max() <= 1e-3 / math.cos(steepest)
    assert len(line) < 400


@pytest.mark.parametrize("angle", [0.15, 0.0, -0.1, 0.9])
def test_a_strobe_figure_shows_zones_below_the_surface(angle: float) -> None:
    """Oracle: where the zones lie on the slope; one without end goes to the edge of the panel or out of it."""
    descent = run(DISC, ICE, ZONED._replace(angle=angle), LAUNCH, max_time=3.0)
    ax = plot.plot_strobe(descent).axes[0]
    drawn = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    assert [to_hex(patch.get_facecolor()) for patch in drawn] == [band.colour for band in bands(ZONED, ICE.friction)]
    for patch, zone in zip(drawn, ZONED.zones, strict=True):
        corners = to_world(np.asarray(patch.get_xy()), -angle)
        assert corners[:, 0].min() == pytest.approx(zone.begin)
        assert corners[:, 0].max() == pytest.approx(zone.end) or zone.end == math.inf
        assert corners[:, 1].max() == pytest.approx(0.0, abs=1e-9)
        assert corners[:, 1].min() < -0.05
    assert [text.get_text() for text in ax.texts] == ["friction 0.01", "friction 0.6"]
    ax.figure.savefig(io.BytesIO(), dpi=40)
