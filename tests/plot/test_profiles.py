"""Figures over a profile: the ground is drawn as it is, and body, contacts, zones and energies are where it says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from sledenv import plot
from sledenv.plot.energy import energy_layers
from sledenv.plot.grounds import below, surface
from sledenv.plot.shapes import contact_paths, to_world
from sledenv.plot.trajectories import rows_between
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import tangents
from tests.plot.outlined import PROFILES, hillside, ride_of


@pytest.fixture(params=list(PROFILES))
def ride(request: pytest.FixtureRequest) -> Descent:
    return ride_of(request.param)


def deepest(descent: Descent) -> float:
    """Most [m] by which a body may be below the ground, along the normal of the plane: pressed springs."""
    steepest = tangents(descent.slope.vertices)[:, 0].min()
    return 1.01 * float(descent.rebounds["peak_penetration"].max() / steepest)


def over_ground(descent: Descent, world: np.ndarray) -> np.ndarray:
    """Height [m] over the ground of points of a figure."""
    x, y = to_world(world, -descent.slope.angle).T
    return np.asarray(y - descent.slope.height_at(x))


def test_what_is_below_a_line_is_as_far_from_each_of_its_pieces() -> None:
    """Oracle: the distance of a point from a straight line."""
    line = surface(hillside().vertices, -3.0, 90.0)
    under = below(line, 0.1)
    for (x, y), piece in zip(tangents(line)[1:-1], range(len(line) - 1), strict=True):
        for end in (under[piece], under[piece + 1]):
            across, up = end - line[piece]
            assert up * x - across * y == pytest.approx(-0.1)


def strobe(descent: Descent) -> Axes:
    return plot.plot_strobe(descent).axes[0]


def test_a_strobe_figure_draws_the_ground_as_it_is(ride: Descent) -> None:
    """Oracle: the heights of the slope, over all of the panel; what is filled has them as its upper edge."""
    ax = strobe(ride)
    line = ax.lines[0].get_xydata()
    assert over_ground(ride, line) == pytest.approx(np.zeros(len(line)), abs=1e-9)
    assert [line[0, 0], -line[-1, 0]] <= [ax.get_xlim()[0], -ax.get_xlim()[1]]
    left, *_, right = to_world(line, -ride.slope.angle)[:, 0]
    assert len(line) == np.count_nonzero((left < ride.slope.vertices[:, 0]) & (ride.slope.vertices[:, 0] < right)) + 2
    filled = np.asarray(ax.collections[0].get_paths()[0].vertices)
    assert filled[: len(line)] == pytest.approx(line)


def test_contacts_lie_on_the_drawn_ground(ride: Descent) -> None:
    """Oracle: the heights of the slope, up to the depth of the springs."""
    paths = contact_paths(ride)
    assert len(paths) == len(ride.rebounds) > 5
    for path in paths:
        places = path[~np.isnan(path[:, 0])]
        assert (np.abs(places[:, 1] - ride.slope.height_at(places[:, 0])) < deepest(ride)).all()
    marks = np.concatenate([line.get_xydata() for line in strobe(ride).lines if line.get_marker() == 6])
    assert len(marks) == len(ride.rebounds)
    assert (np.abs(over_ground(ride, marks)) < deepest(ride)).all()
    assert marks[:, 0].max() > 10.0


def test_zones_lie_along_the_pieces() -> None:
    """Oracle: their upper edges are the ground between their ends; words stand below the ground."""
    ride = ride_of("rock")
    ax = strobe(ride)
    drawn = [patch for patch in ax.patches if isinstance(patch, Polygon)]
    for patch, zone in zip(drawn, ride.slope.zones, strict=True):
        corners = np.asarray(patch.get_xy())[:-1]
        upper = corners[: len(corners) // 2]
        assert over_ground(ride, upper) == pytest.approx(np.zeros(len(upper)), abs=1e-9)
        assert upper[0, 0] == zone.begin
        assert upper[-1, 0] == pytest.approx(min(zone.end, ax.get_xlim()[1]))
        assert over_ground(ride, corners[len(upper) :]).max() < -0.5
    assert [text.get_text() for text in ax.texts] == ["friction 0.3", "friction 0.8"]
    for text in ax.texts:
        x, y = text.get_position()
        assert y < ride.slope.height_at(x) - 1.0


def test_the_layers_of_the_energy_add_up_and_heights_count(ride: Descent) -> None:
    """Oracles: conservation, with surfaces of zones; m g times the height in the world."""
    rows = drawable_rows(ride)
    layers = energy_layers(ride, rows)
    sums = np.sum(list(layers.values()), axis=0)
    assert sums == pytest.approx(sums[0], rel=1e-3)
    angle = ride.slope.angle
    height = rows["y"] * math.cos(angle) - rows["x"] * math.sin(angle)
    expected = ride.body.mass * ride.slope.gravity * (height - height.min())
    assert layers["potential"] == pytest.approx(expected)
    assert np.ptp(height) > 5.0


def test_moments_of_forces_on_a_profile_turn_the_body(ride: Descent) -> None:
    """Oracle: Euler's law, J domega = moment dt, over one contact."""
    rebound = ride.rebounds[0]
    rows = rows_between(ride, float(rebound["t_touchdown"]), float(rebound["t"]))
    ax = plot.plot_impact(ride, float(rows["t"][0]), float(rows["t"][-1])).axes[2]
    t, moment = np.asarray(ax.lines[-1].get_xydata()).T
    turned = np.trapezoid(moment, 1e-3 * t)
    assert turned == pytest.approx(ride.body.inertia * (rebound["omega_after"] - rebound["omega_before"]), rel=0.02)


def test_a_strobe_picture_shows_a_stretch_of_a_ride(ride: Descent) -> None:
    """Oracle: the places of the mass centre there, and the ends of the stretch on the ground."""
    x = drawable_rows(ride)["x"]
    low, high = (float(np.quantile(x, share)) for share in (0.1, 0.8))
    figure = plot.plot_strobe(ride, between=(low, high))
    ends = to_world(np.array([[place, float(ride.slope.height_at(place))] for place in (low, high)]), ride.slope.angle)
    assert len(figure.axes) == 2  # one row, and the bar of speeds
    left, right = figure.axes[0].get_xlim()
    assert left < ends[0, 0] < ends[1, 0] < right
    assert right - left < 2.0 * (ends[1, 0] - ends[0, 0]) + 4.0 * ride.body.size
