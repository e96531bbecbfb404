"""Every number and figure of the paper, computed anew in one folder: the command ``sledenv reproduce``."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.checks import Solver
from sledenv.descent import Descent, FrictionSign, simulate
from sledenv.files import publish, write_csv
from sledenv.geometry import support_height
from sledenv.impact import rigid_impact
from sledenv.kernel.records import Feature
from sledenv.params import Body, ContactLaw, Slope, State, circular_segment
from sledenv.plot import plot_convergence, plot_mode_map, plot_table_1, plot_velocities, plot_worked_example
from sledenv.wheel import collide_wheel

Floats = NDArray[np.float64]

FILES: Final = (
    "index.md",
    "table.md",
    "table.csv",
    "fig_7_10.png",
    "fig_7_10.csv",
    "fig_12_14.png",
    "fig_12_14.csv",
    "table_1.png",
    "table_1.csv",
    "mode_map.png",
    "mode_map.csv",
    "convergence.png",
    "convergence.csv",
)

# The worked example, with the speed that its printed T(0) = 50 J needs; the paper prints V_y(0) = -1 m/s.
EXAMPLE_BODY: Final = Body(mass=1.0, radius=0.1, eccentricity=0.05, inertia=7.5e-3)
EXAMPLE_LAW: Final = ContactLaw(stiffness=9.81e3, asymmetry=0.5, friction=0.1, rolling_arm=0.001)
EXAMPLE_LAUNCH: Final = State(x=0.0, y=0.07, phi=math.pi / 4, u=0.0, v=-10.0, omega=0.0)
EXAMPLE_END: Final = 0.04  # [s]
EULER_STEP: Final = 2.5e-7  # [s]
PRINTED_SPEED: Final = -1.0  # [m/s] V_y(0) as printed
PRINTED_ENERGIES: Final = 50.0, 26.43  # [J] T(0), T(0.04 s) as printed
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

# Friction, rolling arm [m] and restitution of the mode maps; the first are those of the worked example.
MODE_LAWS: Final = ((0.1, 0.001, EXAMPLE_LAW.restitution), (0.3, 0.01, 0.5))

_SIGNS: Final[tuple[FrictionSign, FrictionSign]] = ("dissipative", "printed")
_SERIES = np.dtype([(name, "f8") for name in ("t", "normal", "tangential", "moment", "kinetic")])
_DPI = 150


# Asymmetry, friction, inertia [kg m^2], phi [rad], u, v [m/s] and omega [rad/s] of impacts followed to the rigid limit.
CONVERGING: Final = {
    "slides throughout": (0.5, 0.1, 7.5e-3, math.pi / 4, 0.0, -10.0, 0.0),
    "slip stops": (0.5, 0.9, 7.5e-3, 0.3, 1.0, -3.0, 0.0),
    "spin, then slip reverses": (0.5, 0.1, 7.5e-3, 0.6, 1.0, -4.0, 6.0),
    "slip, then spin reverses": (0.3, 0.15, 2e-3, -0.9, 0.3, -5.0, -10.0),
}


class Row(NamedTuple):
    """One line of the table of numbers."""

    id: str
    where: str  # in the paper
    quantity: str
    unit: str
    paper: str  # as printed, empty where the paper has no number
    ours: float | str
    form: str  # in which table.md shows it
    why: str  # they differ, or what it means


class Example(NamedTuple):
    """The runs of the worked example that figures and table share."""

    exact: Descent  # event-driven
    euler: Descent  # explicit Euler, dissipative friction sign
    printed: Descent  # explicit Euler, the printed friction sign


def reproduce(folder: str | Path = "reproduction", *, progress: Callable[[str], None] = print) -> Path:
    """Compute everything quantitative in the paper and write it into one folder.

    Figures 7-10 and 12-14, Table 1 as a map, the modes of an eccentric impact, and a table that sets the paper's
    numbers against ours with the reason of each difference; docs/physics.md, section 2, derives the corrections.

    Parameters
    ----------
    folder : str or path
        Made anew in one move when all is complete. It may exist if it holds nothing but an earlier reproduction.
    progress : callable
        Called with one line before each part.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    OSError
        If the folder cannot be written or holds files of another origin; it is then left as it was.
    """
    with publish(folder, FILES) as new:
        progress("Figures 7-10: the worked example, event-driven and by explicit Euler")
        example = worked_example()
        _write_worked_example(new, example)
        progress("Figures 12-14: the sled hops down an incline")
        sled = sled_descent()
        _write_sled(new, sled)
        progress("Table 1 as a map")
        _write_table_1(new)
        progress("Modes of an eccentric impact as a map")
        _write_mode_map(new)
        progress("Convergence to the rigid impact")
        _write_convergence(new)
        progress("Table of numbers")
        rows = [*example_rows(example), *table_1_rows(), *sled_rows(sled)]
        _write_table(new, rows)
        _write_index(new, example)
    return Path(folder)


def worked_example() -> Example:
    """Compute the paper's worked example up to 0.04 s, with trajectories."""
    return Example(_fall("compliant"), _fall(), _fall(sign="printed"))


def _fall(
    solver: Solver = "euler",
    *,
    sign: FrictionSign = "dissipative",
    asymmetry: float = EXAMPLE_LAW.asymmetry,
    end: float = EXAMPLE_END,
    step: float = EULER_STEP,
    record: bool = True,
) -> Descent:
    return simulate(
        EXAMPLE_BODY,
        EXAMPLE_LAW._replace(asymmetry=asymmetry),
        NO_GRAVITY,
        EXAMPLE_LAUNCH,
        solver=solver,
        friction_sign=sign,
        max_time=end,
        step=step,
        sample_interval=5e-5,
        record="trajectory" if record else "rebounds",
    )


def force_series(descent: Descent, sign: FrictionSign = "dissipative") -> np.ndarray:
    """Forces [N], their moment about the mass centre [N m] and the kinetic energy [J] over time [s] of a full disc.

    ``sign`` is that of the friction term in the moment equation, paper (10), by which the descent was computed.
    """
    rows = descent.trajectory
    series = np.zeros(len(rows), _SERIES)
    for name in ("t", "normal", "tangential"):
        series[name] = rows[name]
    a, b = _arms(descent.body, rows["phi"])
    friction_moment = (1.0 if sign == "dissipative" else -1.0) * b * rows["tangential"]
    series["moment"] = -a * rows["normal"] + friction_moment + rows["rolling"]
    squares = np.square(rows["u"]) + np.square(rows["v"])
    series["kinetic"] = 0.5 * descent.body.mass * squares + 0.5 * descent.body.inertia * np.square(rows["omega"])
    return series


def _arms(body: Body, phi: Floats) -> tuple[Floats, Floats]:
    """Arms [m] of the arc of a body at orientations [rad]: docs/physics.md (1.2)."""
    return body.eccentricity * np.sin(phi), body.radius - body.eccentricity * np.cos(phi)


def sled_descent() -> Descent:
    """Compute the descent of the paper's 100 kg sled; what the paper leaves open is assumed."""
    height = SLED_DROP + support_height(SLED, SLED_PHI)
    launch = State(0.0, height, SLED_PHI, SLED_SPEED, 0.0, 0.0)
    return simulate(SLED, SLED_LAW, SLED_SLOPE, launch, record="trajectory", sample_interval=0.005)


def printed_rules(
    speed_ratio: Floats, friction: Floats, restitution: Floats, arm: Floats, inertia: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which rules of existence hold, as printed in Table 1 and as corrected, docs/physics.md, sections 2.4 and 3.

    Parameters
    ----------
    speed_ratio : ndarray
        u0/v0 [-], >= 0.
    friction, restitution : ndarray
        f and R [-].
    arm, inertia : ndarray
        delta/r and J/(m r^2) [-].

    Returns
    -------
    (printed, corrected) : ndarray of bool
        Four rows, those of Table 1, of the broadcast shape. Velocities and impulses have the corrected signs in both:
        with the printed ones friction would accelerate the wheel.
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


def example_rows(example: Example) -> list[Row]:
    """Numbers of the worked example: Fig. 7-10 and the conclusions that the paper draws from them."""
    exact, euler, printed = example
    t_start, t_end = PRINTED_ENERGIES
    slow = 0.5 * EXAMPLE_BODY.mass * PRINTED_SPEED**2
    printed_half = _fall(sign="printed", step=EULER_STEP / 2, record=False)
    printed_limit = 2.0 * printed_half.energy.kinetic - printed.energy.kinetic  # Richardson, first order
    long, long_half = (
        _fall(sign="printed", step=step, end=0.05, record=False) for step in (EULER_STEP, EULER_STEP / 2)
    )
    leaves = 2.0 * float(long_half.rebounds["t"][0]) - float(long.rebounds["t"][0])
    leaves_with = 2.0 * long_half.energy.kinetic - long.energy.kinetic
    elastic, elastic_printed = (
        _fall(sign=sign, asymmetry=0.0, end=0.05, record=False).energy.kinetic for sign in _SIGNS
    )
    rows = exact.trajectory
    touching = rows["feature"] != Feature.NONE
    a, b = _arms(exact.body, rows["phi"])
    gap_rate = rows["v"] - a * rows["omega"]
    moment = force_series(exact)["moment"]
    turn = _first_crossing(rows["t"][touching], gap_rate[touching])
    reversal = _first_crossing(rows["t"][touching], moment[touching])
    slips = np.unique(rows["slip"][touching])
    complete = len(slips) == 1 and slips[0] != 0
    spins = np.unique(rows["spin"][touching])
    depth = float(np.max(b[touching] - rows["y"][touching]))
    size = EXAMPLE_BODY.radius**2 - EXAMPLE_BODY.eccentricity**2
    rigid = rigid_impact(EXAMPLE_BODY, EXAMPLE_LAW, EXAMPLE_LAUNCH)
    lost = rigid.loss_hysteresis + rigid.loss_sliding + rigid.loss_rolling
    gone = "printed sign of friction in (10), which creates energy (docs/physics.md, section 2.1)"
    where = "worked example, Fig. 10"
    return [
        Row("t0_printed_speed", where, f"T(0) with V_y = {PRINTED_SPEED:g} m/s", "J", f"{t_start:g}", slow, ".4f",
            "the printed speed does not give the printed energy"),
        Row("speed", where, "speed V_y that gives it", "m/s", f"{PRINTED_SPEED:g}",
            -math.sqrt(2.0 * t_start / EXAMPLE_BODY.mass), ".4f", "its square gives the energy"),
        Row("t0", where, f"T(0) with V_y = {EXAMPLE_LAUNCH.v:g} m/s", "J", f"{t_start:g}", exact.energy.initial, ".4f",
            "what the runs below begin with"),
        Row("t_end_euler", where, "T(0.04 s), Euler, dissipative sign", "J", f"{t_end:g}", euler.energy.kinetic, ".4f",
            _not_reproduced(euler.energy.kinetic)),
        Row("t_end_limit", where, "T(0.04 s), time step to 0, dissipative sign", "J", f"{t_end:g}",
            exact.energy.kinetic, ".4f", "event-driven; " + _not_reproduced(exact.energy.kinetic)),
        Row("t_end_euler_printed", where, "T(0.04 s), Euler, printed sign", "J", f"{t_end:g}",
            printed.energy.kinetic, ".4f", f"{gone}; " + _not_reproduced(printed.energy.kinetic)),
        Row("t_end_limit_printed", where, "T(0.04 s), time step to 0, printed sign", "J", f"{t_end:g}",
            printed_limit, ".4f", "extrapolated from two time steps; still in contact at 0.04 s; "
            + _not_reproduced(printed_limit)),
        Row("t_separation_euler_printed", where, "T after separation, Euler, printed sign", "J", "",
            long.energy.kinetic, ".4f", f"the paper's {t_end:g} J is not this either"),
        Row("separation_printed", where, "separation with the printed sign", "s", "", leaves, ".4f",
            "later than the 0.04 s for which the paper gives its energy"),
        Row("t_separation_printed", where, "T after separation, time step to 0, printed sign", "J", "",
            leaves_with, ".4f", "extrapolated likewise"),
        Row("separation", where, "separation with the dissipative sign", "s", "", float(exact.rebounds["t"][0]), ".4f",
            "the duration of the impact for the given stiffness"),
        Row("elastic_printed", "equation (10)", "T after the impact with Delta = 0, printed sign", "J", "",
            elastic_printed, ".2f", f"more than the {t_start:g} J that it began with: the printed sign creates energy"),
        Row("elastic", "equation (10)", "T after the impact with Delta = 0, dissipative sign", "J", "", elastic, ".2f",
            "friction and rolling resistance take the rest"),
        Row("slip_directions", "Fig. 8", "directions of slip during contact", "-", "1", float(len(slips)), ".0f",
            "complete sliding confirmed" if complete else "complete sliding not confirmed"),
        Row("compression_ends", "Fig. 9", "end of the first phase", "s", "", turn, ".4f", "gap rate zero"),
        Row("moment_reverses", "Fig. 9", "reversal of the total moment", "s", "in the first phase", reversal, ".4f",
            "during restitution, not in the first phase" if reversal > turn else "in the first phase"),
        Row("spin_directions", "Fig. 9", "directions of spin, thus of rolling resistance", "-", "2",
            float(len(spins)), ".0f", "rolling resistance does not change its direction"
            if len(spins) == 1 else "rolling resistance changes its direction"),
        Row("depth", where, "greatest penetration", "m", "", depth, ".4f",
            f"of a radius of {EXAMPLE_BODY.radius:g} m: a test of the equations, not a small deformation"),
        Row("inertia", "worked example", "m (r^2 - h^2)", "kg m^2", f"{EXAMPLE_BODY.inertia:g}",
            EXAMPLE_BODY.mass * size, ".6f", "equal: the body is a thin arc, not a lamina"),
        Row("t_rigid", where, "T after the impact in the limit of infinite stiffness", "J", "",
            t_start - lost, ".4f", "docs/physics.md, section 4"),
        Row("ledger", where, "energy unaccounted for, event-driven", "J", "", exact.energy.residual, ".0e",
            "the error of the integration"),
    ]  # fmt: skip


def _not_reproduced(ours: float) -> str:
    paper = PRINTED_ENERGIES[1]
    if round(ours, 2) == paper:
        return "reproduced"
    return f"{paper:g} J not reproducible ({100.0 * (ours / paper - 1.0):+.1f} %)"


def _first_crossing(t: Floats, values: Floats) -> float:
    """First time at which ``values`` change their sign, by linear interpolation; inf if they do not."""
    signs = np.sign(values)
    nonzero = np.flatnonzero(signs)
    change = np.flatnonzero(signs[nonzero][1:] != signs[nonzero][:-1])
    if change.size == 0:
        return math.inf
    i, j = nonzero[change[0]], nonzero[change[0] + 1]
    return float(t[i] - values[i] * (t[j] - t[i]) / (values[j] - values[i]))


def table_1_rows() -> list[Row]:
    """Numbers about Table 1: how often its printed rules tell the scenarios apart, and what its signs do."""
    rng = np.random.default_rng(SEED)
    draws = rng.random((6, SAMPLES))
    first, second = (_rule_counts(*_drawn(draws, wide)) for wide in (False, True))
    f, restitution, arm, inertia, ratio = _drawn(draws, False)
    _, corrected = printed_rules(ratio, f, restitution, arm, inertia)
    names = np.array(["slide-roll", "stop-roll", "slide", "stuck"])
    scenario = collide_wheel(1.0, inertia, 1.0, f, arm, restitution, ratio, -1.0).scenario
    agree = float(np.mean(names[np.argmax(corrected, axis=0)] == scenario.astype(str)))
    # Scenario 2 as printed, without rolling resistance: m(u1 - u0) = SF, J w1 = -r SF, u1 + w1 r = 0, J = m r^2/2.
    u1, w1, _ = np.linalg.solve([[1.0, 0.0, -1.0], [0.0, 0.5, 1.0], [1.0, 1.0, 0.0]], [1.0, 0.0, 0.0])
    gain = u1**2 + 0.5 * w1**2  # over u0^2 = 1
    ranges = "f, R in [0, 1], delta/r in [0, 0.5], J/(m r^2) in [0.3, 1], u0, v0 in [0, 5] m/s, uniform"
    return [
        Row("printed_overlap", "Table 1", "inputs for which several printed rules hold", "%", "",
            100.0 * first[0], ".1f", f"the share depends on the inputs, here {ranges}"),
        Row("printed_overlap_unit", "Table 1", "the same with all six uniform in [0, 1]", "%", "",
            100.0 * second[0], ".1f", "the share depends on the inputs"),
        Row("corrected_unique", "Table 1", "inputs for which exactly one corrected rule holds", "%", "",
            100.0 * first[1], ".4f", "docs/physics.md, section 3"),
        Row("closed_form_agrees", "Table 1", "inputs for which the closed form names that scenario", "%", "",
            100.0 * agree, ".4f", "sledenv.collide_wheel"),
        Row("scenario_2_printed", "equations (2), (3), Table 1", "tangential energy after scenario 2 over before", "-",
            "", float(gain), ".4f", "printed signs, J = m r^2/2, delta = 0: energy out of nothing"),
    ]  # fmt: skip


def _drawn(draws: Floats, unit: bool) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Friction, restitution, rolling arm, inertia and speed ratio out of six uniform draws."""
    f, restitution, arm, inertia, u, v = draws
    v = 1.0 - v  # in (0, 1]
    if unit:
        return f, restitution, arm, 1.0 - inertia, u / v
    return f, restitution, 0.5 * arm, 0.3 + 0.7 * inertia, u / v


def _rule_counts(
    friction: Floats, restitution: Floats, arm: Floats, inertia: Floats, ratio: Floats
) -> tuple[float, float]:
    """Share of inputs that obey several printed rules, and of those that obey exactly one corrected rule."""
    printed, corrected = printed_rules(ratio, friction, restitution, arm, inertia)
    return float(np.mean(printed.sum(axis=0) > 1)), float(np.mean(corrected.sum(axis=0) == 1))


def sled_rows(descent: Descent) -> list[Row]:
    """Numbers of the sled: Fig. 12-14."""
    assumed = " ".join(SLED_ASSUMED.split())
    rebounds = float(np.count_nonzero(descent.rebounds["t"] < descent.time))
    where = "Fig. 12-14"
    fastest = float(np.max(np.abs(descent.trajectory["omega"])))
    return [
        Row("sled_status", where, "how the descent ends", "-", "", str(descent.status), "", assumed),
        Row("sled_time", where, "its duration", "s", "", descent.time, ".3f", "the paper prints no numbers"),
        Row("sled_rebounds", where, "rebounds", "-", "", rebounds, ".0f", "impacts that ended before the descent did"),
        Row("sled_speed", where, "speed along the slope at the end", "m/s", "", descent.state.u, ".3f", ""),
        Row("sled_spin", where, "greatest spin", "rad/s", "", fastest, ".3f", ""),
    ]  # fmt: skip


def _write_worked_example(folder: Path, example: Example) -> None:
    signs: tuple[FrictionSign, ...] = ("dissipative", "dissipative", "printed")
    labels = (
        "event-driven, dissipative friction sign",
        f"Euler, Δt = {1e6 * EULER_STEP:g} µs, the same sign",
        "Euler, printed friction sign (creates energy)",
    )
    runs = {label: force_series(run, sign) for label, run, sign in zip(labels, example, signs, strict=True)}
    figure = plot_worked_example(runs, paper=(EXAMPLE_END, PRINTED_ENERGIES[1]))
    figure.savefig(folder / "fig_7_10.png", dpi=_DPI)
    keys = ("event-driven", "euler", "euler-printed-sign")
    write_csv(
        folder / "fig_7_10.csv",
        ("run", "t_s", "normal_n", "tangential_n", "moment_n_m", "kinetic_j"),
        ((key, *row) for key, rows in zip(keys, runs.values(), strict=True) for row in rows.tolist()),
    )


def _write_sled(folder: Path, descent: Descent) -> None:
    given = "Given in the paper: 100 kg, friction 0.03, restitution 0.5."
    plot_velocities(descent, note=f"{given}\n{SLED_ASSUMED}").savefig(folder / "fig_12_14.png", dpi=_DPI)
    rows = descent.trajectory
    sine, cosine = math.sin(descent.slope.angle), math.cos(descent.slope.angle)
    columns = (
        rows["t"],
        rows["v"] * cosine - rows["u"] * sine,
        rows["u"] * cosine + rows["v"] * sine,
        rows["omega"],
        (rows["feature"] != Feature.NONE).astype(int),
    )
    write_csv(
        folder / "fig_12_14.csv",
        ("t_s", "vertical_m_s", "horizontal_m_s", "spin_rad_s", "in_contact"),
        zip(*(column.tolist() for column in columns), strict=True),
    )


def _write_table_1(folder: Path) -> None:
    ratio, friction = _middles(0.0, 1.2, 160), _middles(0.0, 0.6, 125)  # no cell lies on a border
    u, f = np.meshgrid(ratio, friction)
    scenario = collide_wheel(1.0, WHEEL_INERTIA, 1.0, f, WHEEL_ARM, WHEEL_RESTITUTION, u, -1.0).scenario.astype(str)
    held, _ = printed_rules(u, f, *(np.array(x) for x in (WHEEL_RESTITUTION, WHEEL_ARM, WHEEL_INERTIA)))
    printed = np.empty(u.shape, dtype="U16")
    for index in np.ndindex(u.shape):
        printed[index] = " + ".join(str(row + 1) for row in range(4) if held[row][index])
    note = (
        f"Uniform disc without spin: J = {WHEEL_INERTIA:g} m r², R = {WHEEL_RESTITUTION:g}, "
        f"rolling arm δ = {WHEEL_ARM:g} r (assumed). Numbers are the rows of Table 1."
    )
    plot_table_1(ratio, friction, scenario, printed, note=note).savefig(folder / "table_1.png", dpi=_DPI)
    write_csv(
        folder / "table_1.csv",
        ("speed_ratio", "friction", "scenario", "printed_rules"),
        zip(*(column.ravel().tolist() for column in (u, f, scenario, printed)), strict=True),
    )


def _write_mode_map(folder: Path) -> None:
    degrees, ratio = _middles(-180.0, 180.0, 240), _middles(-2.0, 2.0, 160)
    panels, lines = {}, []
    for friction, arm, restitution in MODE_LAWS:
        law = EXAMPLE_LAW._replace(friction=friction, rolling_arm=arm)
        modes = np.zeros((len(ratio), len(degrees)), dtype=int)
        for i, speed in enumerate(ratio.tolist()):
            for j, angle in enumerate(degrees.tolist()):
                state = State(0.0, 0.0, math.radians(angle), speed, -1.0, 0.0)
                mode = rigid_impact(EXAMPLE_BODY, law, state, restitution=restitution).mode
                modes[i, j] = mode
                lines.append((friction, arm, restitution, angle, speed, mode.name.lower().replace("_", "-")))
        panels[f"f = {friction:g}, δ = {1e3 * arm:g} mm, e = {restitution:.3g}"] = modes
    note = "How one rigid impact ends: the body of the worked example, without spin at touch."
    plot_mode_map(np.radians(degrees), ratio, panels, note=note).savefig(folder / "mode_map.png", dpi=_DPI)
    write_csv(
        folder / "mode_map.csv",
        ("friction", "rolling_arm_m", "restitution", "phi_deg", "speed_ratio", "mode"),
        lines,
    )


def _write_convergence(folder: Path) -> None:
    stiffness = 10.0 ** np.arange(8, 13)
    errors = {}
    for name, (asymmetry, friction, inertia, phi, u, v, omega) in CONVERGING.items():
        body = EXAMPLE_BODY._replace(inertia=inertia)
        law = EXAMPLE_LAW._replace(asymmetry=asymmetry, friction=friction)
        launch = State(0.0, support_height(body, phi), phi, u, v, omega)
        exact = rigid_impact(body, law, launch).state
        error = []
        for c in stiffness.tolist():
            soft = simulate(body, law._replace(stiffness=c), NO_GRAVITY, launch, max_rebounds=1).state
            turning = body.radius * (soft.omega - exact.omega)
            error.append(math.hypot(soft.u - exact.u, soft.v - exact.v, turning))
        errors[name] = np.array(error)
    note = "One impact of the two-stiffness contact against the exact rigid one, without gravity"
    plot_convergence(stiffness, errors, note=note).savefig(folder / "convergence.png", dpi=_DPI)
    write_csv(
        folder / "convergence.csv",
        ("stiffness_n_m", *(f"{name.replace(' ', '_').replace(',', '')}_m_s" for name in errors)),
        zip(stiffness.tolist(), *(error.tolist() for error in errors.values()), strict=True),
    )


def _middles(low: float, high: float, cells: int) -> Floats:
    """Middles of equal cells."""
    edges = np.linspace(low, high, cells + 1)
    return np.round(0.5 * (edges[1:] + edges[:-1]), 12)


def _write_table(folder: Path, rows: list[Row]) -> None:
    write_csv(
        folder / "table.csv",
        ("id", "where", "quantity", "unit", "paper", "ours", "why"),
        ((row.id, row.where, row.quantity, row.unit, row.paper, row.ours, row.why) for row in rows),
    )
    lines = ["| where | quantity | paper | ours | why they differ |", "|---|---|---|---|---|"]
    for row in rows:
        ours = row.ours if isinstance(row.ours, str) else f"{row.ours:{row.form}}"
        unit = "" if row.unit == "-" else f" {row.unit}"
        paper = f"{row.paper}{unit}" if row.paper.lstrip("-")[:1].isdigit() else row.paper
        lines.append(f"| {row.where} | {row.quantity} | {paper} | {ours}{unit} | {row.why} |")
    (folder / "table.md").write_text("# The paper's numbers and ours\n\n" + "\n".join(lines) + "\n", encoding="utf-8")


def _write_index(folder: Path, example: Example) -> None:
    ends = (f"{run.energy.kinetic:.2f} J" for run in (example.euler, example.printed))
    text = _INDEX.format(*ends, paper=f"{PRINTED_ENERGIES[1]:g} J", assumed=SLED_ASSUMED)
    (folder / "index.md").write_text(text, encoding="utf-8")


_INDEX = """# The paper, computed anew

Source: *Analysis of oblique collision between parallel-plane moving constrained body and obstacle*. Corrections to it
are derived in docs/physics.md, section 2. Written by `sledenv reproduce`; all numbers were computed by that run.

| part of the paper | figure | data |
|---|---|---|
| Fig. 7-10, the worked example | [fig_7_10.png](fig_7_10.png) | [fig_7_10.csv](fig_7_10.csv) |
| Fig. 12-14, the sled on an incline | [fig_12_14.png](fig_12_14.png) | [fig_12_14.csv](fig_12_14.csv) |
| Table 1, the collision scenarios of a wheel | [table_1.png](table_1.png) | [table_1.csv](table_1.csv) |
| the same question for the eccentric body | [mode_map.png](mode_map.png) | [mode_map.csv](mode_map.csv) |
| the rigid limit of the contact model | [convergence.png](convergence.png) | [convergence.csv](convergence.csv) |
| every number | [table.md](table.md) | [table.csv](table.csv) |

## Fig. 7-10

![Forces, moment and kinetic energy of the worked example](fig_7_10.png)

m = 1 kg, r = 0.1 m, h = 0.05 m, J = 7.5e-3 kg m², f = 0.1, δ = 1 mm, c = 9.81 kN/m, Δ = 0.5, y = 0.07 m, φ = 45°, no
gravity, and V_y = -10 m/s, which T(0) = 50 J needs. Euler's method ends with T(0.04 s) = {} for the dissipative
sign of friction and {} for the printed one; the paper prints {paper}.

## Fig. 12-14

![Velocities of the sled](fig_12_14.png)

{assumed}

## Table 1

![Scenarios of a wheel over speed ratio and friction](table_1.png)

On the left the corrected rules; on the right those of the printed rules that hold, hatched where there are several.
How often that is so, and how often exactly one corrected rule holds: [table.md](table.md).

## Eccentric body

![Modes of an eccentric impact over orientation and direction of approach](mode_map.png)

How one rigid impact of the worked example's body ends, without spin at touch.
"""
