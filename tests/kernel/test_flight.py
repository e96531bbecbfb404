"""Free flight: the first touchdown is found, a grazing one included, and the end of the slope is reached in time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sledenv import ContactLaw, Slope, State, simulate
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.support import support_height
from tests.bodies import rod, segment_by_share, touching
from tests.oracles import support

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
ROD = rod(1.0, 0.4, 0.02)
WHEEL = segment(1.0, 0.1, 0.0, 5e-3)
SEGMENT = circular_segment(1.0, 0.5, math.radians(110.0))
BODIES = [DISC, ROD, WHEEL, SEGMENT, segment(1.0, 0.1, 0.1, 0.01, 2.5)]

bodies = st.one_of(
    st.sampled_from(BODIES),
    st.floats(0.3, math.pi).map(lambda half_angle: circular_segment(1.0, 0.5, half_angle)),
    st.builds(
        lambda share, half_angle: segment_by_share(1.0, 0.5, share, 0.1, half_angle),
        st.floats(0.0, 1.0),
        st.floats(0.3, 3.1),
    ),
)
orientations = st.floats(-10.0, 10.0)
spins = st.one_of(st.just(0.0), st.floats(-10.0, 10.0), st.floats(-200.0, 200.0))
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)


def touchdown_time(
    body: Segment, gravity: float, y: float, phi: float, v: float, omega: float, horizon: float
) -> float:
    """Touchdown of a flight; inf if there is none up to the horizon."""
    launch = State(0.0, y, phi, 0.0, v, omega)
    descent = simulate(body, LAW, Slope(0.0, gravity=gravity), launch, max_time=horizon, max_rebounds=1)
    return float(descent.rebounds["t_touchdown"][0]) if len(descent.rebounds) else math.inf


def finish_time(x: float, u: float, acceleration: float, length: float) -> float:
    """Time at which a flight reaches the end of the slope; inf if it does not within an hour."""
    slope = Slope(math.asin(acceleration / 9.81), length) if acceleration else Slope(0.0, length, 0.0)
    launch = State(x, 1e8, 0.0, u, 0.0, 0.0)
    descent = simulate(WHEEL, LAW, slope, launch, max_time=3600.0)
    return descent.time if descent.status == "finish" else math.inf


def gaps_at(
    body: Segment, gravity: float, y: float, phi: float, v: float, omega: float, t: float | np.ndarray
) -> np.ndarray:
    """Gaps [m] at times of a free flight."""
    return np.asarray(y + t * (v - 0.5 * gravity * t) - support(body, np.asarray(phi + omega * t)))


def check_flight(body: Segment, *flight: float, horizon: float = 2.0, samples: int = 20_001) -> float:
    """The touchdown, which is a root of the gap: no sampled gap before it is below zero."""
    found = touchdown_time(body, *flight, horizon)
    assert gaps_at(body, *flight, np.linspace(0.0, min(found, horizon), samples)[1:-1]).min() > -1e-12
    if found < math.inf:
        assert gaps_at(body, *flight, found) == pytest.approx(0.0, abs=1e-13 * (1.0 + abs(flight[-1])))
    return found


@given(bodies, st.sampled_from([0.0, 9.81]), st.floats(1e-6, 2.0), orientations, st.floats(-5.0, 5.0), spins)
def test_touchdown_is_the_first_root_of_the_gap(
    body: Segment, gravity: float, clearance: float, phi: float, v: float, omega: float
) -> None:
    """Oracle: 20,000 points of the gap; between launch and touchdown none of them lies below the surface."""
    check_flight(body, gravity, support_height(body, phi) + clearance, phi, v, omega)


@given(bodies, st.sampled_from([0.0, 9.81]), orientations, st.floats(-3.0, 3.0), st.floats(-200.0, 200.0))
def test_a_body_that_leaves_the_surface_comes_down_at_the_first_root(
    body: Segment, gravity: float, phi: float, departure: float, omega: float
) -> None:
    """Oracle: the scan; a start on the surface is not a touchdown unless the body moves down."""
    assume(abs(departure) > 0.05 or departure < -1e-6)  # the scan resolves the hop
    y, a = support_height(body, phi), touching(body, phi)[1]
    v = departure + a * omega
    assert (check_flight(body, gravity, y, phi, v, omega) == 0.0) == (departure < 0.0)


@pytest.mark.parametrize(("body", "omega"), [(DISC, 5000.0), (ROD, 500.0), (SEGMENT, 50.0)])
def test_fast_spin_hides_no_root(body: Segment, omega: float) -> None:
    """Oracle: the scan, 200 points per turn, of a slow fall: the body touches while its longest side passes below."""
    check_flight(body, 0.0, 1.2, 0.3, -0.5, omega, horizon=3.0, samples=int(100 * omega))


@pytest.mark.parametrize("clearance", [1e-15, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("omega", [3.0, -1000.0, 1e-3])
@pytest.mark.parametrize("phi", [0.0, -2.0])
def test_a_graze_is_told_from_a_miss_and_from_a_touch(clearance: float, omega: float, phi: float) -> None:
    """Oracle: gap h (1 + cos(phi + omega t)) +- clearance: never zero, or first zero where the cosine says."""
    horizon = 20.0 / abs(omega)
    assert touchdown_time(DISC, 0.0, 0.15 + clearance, phi, 0.0, omega, horizon) == math.inf
    turned = math.acos(clearance / 0.05 - 1.0) - math.copysign(1.0, omega) * phi
    found = touchdown_time(DISC, 0.0, 0.15 - clearance, phi, 0.0, omega, horizon)
    assert abs(omega) * found == pytest.approx(turned, abs=4e-16 / math.sqrt(clearance))


def test_a_heavy_side_that_swings_up_lifts_the_body() -> None:
    """Oracle: at phi = pi and v = 0 the gap is h (1 - cos(omega t)) - g t^2/2: lifted iff h omega^2 > g."""
    g, h = 9.81, DISC.eccentricity
    _, a, y = touching(DISC, math.pi)  # a is not quite zero
    for sign in (1.0, -1.0):
        slow, fast = sign * 0.99 * math.sqrt(g / h), sign * 2.0 * math.sqrt(g / h)
        assert touchdown_time(DISC, g, y, math.pi, a * slow, slow, 10.0) == 0.0
        assert check_flight(DISC, g, y, math.pi, a * fast, fast) > 0.1
    assert touchdown_time(DISC, g, 0.05, 0.0, 0.0, 2.0 * math.sqrt(g / h), 10.0) == 0.0  # pressed down at phi = 0


def test_a_touchdown_at_rounding_speed_is_not_below_the_surface() -> None:
    """Oracle: the gap at the touchdown of a body that rests on the surface but for rounding."""
    for departure in np.geomspace(1e-16, 1e-9, 60):
        for phi in (0.3, 1.1, -1.7):
            y = support_height(DISC, phi)
            v = departure + 0.05 * math.sin(phi) * 0.2
            found = touchdown_time(DISC, 9.81, y, phi, v, 0.2, 1.0)
            assert gaps_at(DISC, 9.81, y, phi, v, 0.2, found) > -1e-13


def zero_or_some(most: float) -> st.SearchStrategy[float]:
    """Zero, or a number of either sign that is no nearer to it than 0.1."""
    return st.just(0.0) | st.floats(0.1, most) | st.floats(-most, -0.1)


@given(st.floats(-5.0, 5.0), zero_or_some(20.0), zero_or_some(9.0), st.floats(5.1, 50.0))
def test_the_finish_is_the_first_place_at_the_end_of_the_slope(x: float, u: float, rate: float, length: float) -> None:
    """Oracle: numpy.roots, and the place at the time found."""
    roots = np.roots([0.5 * rate, u, x - length]) if rate != 0.0 else np.roots([u, x - length])
    ahead = [z.real for z in roots if z.imag == 0.0 and z.real > 0.0]
    found = finish_time(x, u, rate, length)
    assume(abs(u * u + 2.0 * rate * (length - x)) > 1e-9)
    if not ahead:
        assert found == math.inf
    else:
        assert found == pytest.approx(min(ahead), rel=1e-6)
    if 0.0 < found < 1e3:
        assert x + found * (u + 0.5 * rate * found) == pytest.approx(length, abs=1e-9 * (1.0 + found))
