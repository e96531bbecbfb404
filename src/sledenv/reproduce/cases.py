"""Data of the paper, our assumptions where it leaves something open, and the runs made with both."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.reproduce.euler import FrictionSign, euler_descent
from sledenv.simulation.bodies import Body, Segment, segment
from sledenv.simulation.outcomes import Descent, DescentBatch, Record
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import support_height, support_heights

Floats = NDArray[np.float64]


# The worked example, with the speed that its printed T(0) = 50 J needs; the paper prints V_y(0) = -1 m/s.
EXAMPLE_BODY: Final = segment(mass=1.0, radius=0.1, eccentricity=0.05, inertia=7.5e-3)
EXAMPLE_LAW: Final = ContactLaw(stiffness=9.81e3, asymmetry=0.5, friction=0.1, rolling_arm=0.001)
EXAMPLE_LAUNCH: Final = State(x=0.0, y=0.07, phi=math.pi / 4, u=0.0, v=-10.0, omega=0.0)
EXAMPLE_END: Final = 0.04  # [s]
EULER_STEP: Final = 2.5e-7  # [s]
_SAMPLE_INTERVAL: Final = 5e-5  # [s]
PRINTED_SPEED: Final = -1.0  # [m/s] V_y(0) as printed
PRINTED_ENERGIES: Final = 50.0, 26.43  # [J] T(0), T(0.04 s) as printed
SIGNS: Final[tuple[FrictionSign, FrictionSign]] = ("dissipative", "printed")
NO_GRAVITY: Final = Slope(angle=0.0, gravity=0.0)

# The sled: the paper gives its mass, friction and restitution, and leaves everything else open.
SLED: Final = circular_segment(mass=100.0, radius=0.5, half_angle=math.radians(110.0))
SLED_LAW: Final = ContactLaw.from_restitution(0.5, stiffness=1e7, friction=0.03, rolling_arm=0.005)
SLED_SLOPE: Final = Slope(angle=math.radians(10.0), length=10.0)
SLED_PHI, SLED_DROP, SLED_SPEED = math.radians(30.0), 1.0, 3.0  # [rad], [m], [m/s]
SLED_ASSUMED: Final = (
    "Assumed, as the paper leaves it open: uniform segment of radius 0.5 m and half-angle 110°, rolling arm 5 mm,\n"
    "stiffness 1e7 N/m, slope of 10° and 10 m, let go 1 m above it at 30° with 3 m/s along it and no spin."
)

# The wheel of Table 1: a uniform disc; the paper gives no numbers.
WHEEL_RESTITUTION, WHEEL_INERTIA, WHEEL_ARM = 0.5, 0.5, 0.25  # [-], [m r^2], [r]
SAMPLES: Final = 200_000
SEED: Final = 0

# The wheel of equation (1) and of Fig. 2 and 4, for which the paper gives no numbers: data of the worked example, but a
# uniform disc with its mass centre on the axis, at the speed that the paper prints.
DISC: Final = EXAMPLE_BODY.replace(eccentricity=0.0, inertia=0.5 * EXAMPLE_BODY.mass * EXAMPLE_BODY.radius**2)
DISC_SPEEDS: Final = {"first": 0.15, "second": 0.35}  # [m/s] u0 at which sliding stops in this phase

# The map of jamming: the launch of the sled but for its orientation and spin, on the paper's ice and on a rough slope.
JAM_FRICTIONS: Final = {"the paper's ice": 0.03, "a rough slope, assumed": 0.3}
JAM_SPINS: Final = (-8.0, 8.0, 160)  # [rad/s] from, to, cells
JAM_ORIENTATIONS: Final = (-180.0, 180.0, 360)  # [deg] likewise

# Friction, rolling arm [m] and restitution of the mode maps; the first are those of the worked example.
MODE_LAWS: Final = ((0.1, 0.001, EXAMPLE_LAW.restitution), (0.3, 0.01, 0.5))

_SERIES = np.dtype([(name, "f8") for name in ("t", "normal", "tangential", "moment", "kinetic")])


class Example(NamedTuple):
    """The runs of the worked example that figures and table share."""

    exact: Descent  # event-driven
    euler: Descent  # explicit Euler, dissipative friction sign
    printed: Descent  # explicit Euler, the printed friction sign


def worked_example() -> Example:
    """Compute the paper's worked example up to 0.04 s, with trajectories."""
    settings = Settings(max_time=EXAMPLE_END, sample_interval=_SAMPLE_INTERVAL)
    exact = simulate(EXAMPLE_BODY, EXAMPLE_LAW, NO_GRAVITY, EXAMPLE_LAUNCH, settings, record="trajectory")
    return Example(exact, fall(), fall(sign="printed"))


def disc_impact(u0: float) -> Descent:
    """Compute one impact of the wheel that arrives with ``u0`` [m/s] along the plane, with its trajectory."""
    touch = State(0.0, DISC.radius, 0.0, u0, PRINTED_SPEED, 0.0)
    settings = Settings(max_rebounds=1, sample_interval=2e-5)
    return simulate(DISC, EXAMPLE_LAW, NO_GRAVITY, touch, settings, record="trajectory")


def jam_map(friction: float) -> DescentBatch:
    """Compute the descents of the sled for all launches of the map, with this friction [-]."""
    spin, phi = np.meshgrid(middles(*JAM_SPINS), np.radians(middles(*JAM_ORIENTATIONS)), indexing="ij")
    launches = np.zeros((phi.size, len(State._fields)))
    launches[:, 2], launches[:, 3], launches[:, 5] = phi.ravel(), SLED_SPEED, spin.ravel()
    launches[:, 1] = SLED_DROP + support_heights(SLED.record, launches[:, 2])
    return simulate_batch(SLED, SLED_LAW._replace(friction=friction), SLED_SLOPE, launches)


def middles(low: float, high: float, cells: int) -> Floats:
    """Middles of equal cells."""
    edges = np.linspace(low, high, cells + 1)
    return np.round(0.5 * (edges[1:] + edges[:-1]), 12)


def fall(
    *,
    sign: FrictionSign = "dissipative",
    asymmetry: float = EXAMPLE_LAW.asymmetry,
    end: float = EXAMPLE_END,
    step: float = EULER_STEP,
    record: bool = True,
) -> Descent:
    """Compute the worked example by Euler's method."""
    what: Record = "trajectory" if record else "rebounds"
    return euler_descent(
        EXAMPLE_BODY,
        EXAMPLE_LAW._replace(asymmetry=asymmetry),
        NO_GRAVITY,
        EXAMPLE_LAUNCH,
        step=step,
        friction_sign=sign,
        max_time=end,
        record=what,
        sample_interval=_SAMPLE_INTERVAL,
    )


def force_series(descent: Descent, sign: FrictionSign = "dissipative") -> np.ndarray:
    """Forces [N], their moment about the mass centre [N m] and the kinetic energy [J] over time [s] of a full disc.

    ``sign`` is that of the friction term in the moment equation, paper (10), by which the descent was computed.
    """
    rows = descent.trajectory
    series = np.zeros(len(rows), _SERIES)
    for name in ("t", "normal", "tangential"):
        series[name] = rows[name]
    a, b = arc_arms(descent.body, rows["phi"])
    friction_moment = (1.0 if sign == "dissipative" else -1.0) * b * rows["tangential"]
    series["moment"] = -a * rows["normal"] + friction_moment + rows["rolling"]
    squares = np.square(rows["u"]) + np.square(rows["v"])
    series["kinetic"] = 0.5 * descent.body.mass * squares + 0.5 * descent.body.inertia * np.square(rows["omega"])
    return series


def arc_arms(body: Body, phi: Floats) -> tuple[Floats, Floats]:
    """Arms [m] of the arc of a segment, as all bodies here, at orientations [rad]: docs/physics.md (1.2)."""
    assert isinstance(body, Segment)
    return body.eccentricity * np.sin(phi), body.radius - body.eccentricity * np.cos(phi)


def sled_descent() -> Descent:
    """Compute the descent of the paper's 100 kg sled; what the paper leaves open is assumed."""
    height = SLED_DROP + support_height(SLED, SLED_PHI)
    launch = State(0.0, height, SLED_PHI, SLED_SPEED, 0.0, 0.0)
    return simulate(SLED, SLED_LAW, SLED_SLOPE, launch, record="trajectory", sample_interval=0.005)


def printed_rules(
    speed_ratio: Floats, friction: Floats, restitution: Floats, arm: Floats, inertia: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rules of existence hold, printed in Table 1 and corrected: docs/physics.md, sections 2.4 and 3.

    Given are u0/v0 >= 0, f, R, delta/r and J/(m r^2) [-]. Each of the two has four rows, those of Table 1, of the
    broadcast shape. Velocities and impulses have the corrected signs in both: with the printed ones friction would
    accelerate the wheel.
    """
    # In units of m, r and v0.
    u, f, delta, about = speed_ratio, friction, arm, inertia + 1.0
    impulse = 1.0 + restitution
    u_slides = u - f * impulse
    rim_slides = -(f - delta) * impulse / inertia
    sticking = (inertia * u + delta * impulse) / about
    row_1 = u_slides + rim_slides >= 0.0
    row_2 = sticking <= f * impulse
    row_3 = f <= delta  # |d| <= delta with d = f r
    row_4 = (u <= f * impulse) & (u <= delta * impulse)
    printed = np.broadcast_arrays(row_1, row_2, row_3, row_4)
    corrected = np.broadcast_arrays(
        (f >= delta) & row_1, (u >= delta * impulse) & row_2, row_3 & (u_slides >= 0.0), row_4
    )
    return np.array(printed), np.array(corrected)
