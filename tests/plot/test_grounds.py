"""Zones of a slope in pictures: where they are, how dark, and what is written below them."""

from __future__ import annotations

import colorsys
import io
import math

import numpy as np
import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.patches import Polygon

from sledenv import ContactLaw, State, disc, plot, simulate
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


def test_the_rougher_a_zone_the_darker_it_is_and_ice_is_blue() -> None:
    """Oracle: lightness and saturation of the colours."""
    around = 0.1
    zones = [Zone(k, k + 1.0, friction, 0.0) for k, friction in enumerate((0.0, 0.05, 0.1, 0.2, 0.5, 3.0))]
    found = [to_rgb(band.colour) for band in bands(Slope(0.1, zones=zones), around)]
    lightness, saturation = np.array([colorsys.rgb_to_hls(*colour)[1:] for colour in found]).T
    assert (np.diff(lightness) < 0.0).all()
    assert saturation[0] > 0.5 > saturation[2:].max()
    smooth = bands(Slope(0.1, zones=zones[:1]), 0.0)[0].colour
    assert to_rgb(smooth) == found[2]  # as slippery as the ground around it


def test_a_label_is_as_long_as_there_is_room() -> None:
    band = bands(ZONED, 0.05)[2]
    assert [band.label(room) for room in (20.0, 8.0, 2.0)] == ["friction 0.6", "0.6", ""]


def test_friction_is_that_of_the_zone() -> None:
    """Oracle: begin belongs to a zone, end to what follows, as the kernel has it."""
    places = np.array([-1.0, 1.99, 2.0, 3.99, 4.0, 4.1, 6.0, 1e9])
    expected = [ICE.friction, ICE.friction, 0.01, 0.01, 0.2, ICE.friction, 0.6, 0.6]
    assert ZONED.friction_at(places, ICE.friction).tolist() == expected
    assert (HILL.friction_at(places, ICE.friction) == ICE.friction).all()


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


def test_a_slope_without_zones_is_drawn_without() -> None:
    ax = plot.plot_strobe(run(DISC, ICE, HILL, LAUNCH)).axes[0]
    assert [patch for patch in ax.patches if isinstance(patch, Polygon)] == list(ax.texts) == []


def test_the_friction_that_is_used_is_that_of_the_zone() -> None:
    """Oracle: Coulomb's law where the body slips."""
    descent = run(DISC, ICE, ZONED, LAUNCH)
    figure = plot.plot_slip(descent)
    rows = descent.trajectory
    used = figure.axes[1].lines[1].get_ydata()
    slipping = (rows["slip"] != 0) & (rows["normal"] > 1e-12 * rows["normal"].max())
    assert (rows["x"][slipping] > 6.5).any()
    assert np.median(np.abs(np.abs(used[slipping]) - 1.0)) < 1e-9


@pytest.mark.parametrize(("length", "tall"), [(40.0, 1.0), (150.0, 10.0)])
def test_heights_of_a_long_picture_are_exaggerated_as_its_axis_says(length: float, tall: float) -> None:
    """Oracle: the pixels of a metre along and of one upwards; a disc of 0.5 m, on a slope that falls by a fiftieth."""
    slope = Slope(math.atan(0.02), length, zones=[Zone(20.0, 40.0, 0.4, 0.0)])
    law = ContactLaw.from_restitution(0.3, stiffness=1e6, friction=0.3, rolling_arm=0.0)
    descent = simulate(disc(50.0, 0.5), law, slope, State(0.0, 0.6, 0.0, 20.0), record="trajectory")
    figure = plot.plot_strobe(descent)
    figure.draw_without_rendering()
    ax = figure.axes[0]
    (left, bottom), (right, top) = ax.transData.transform([(0.0, 0.0), (1.0, 1.0)])
    assert (top - bottom) / (right - left) == pytest.approx(tall)
    assert ax.get_ylabel() == ("height [m]" if tall == 1.0 else "height [m]\nvertical exaggeration 10")
    low, high = ax.get_ylim()
    assert low < -0.02 * length
    assert high > 0.6
