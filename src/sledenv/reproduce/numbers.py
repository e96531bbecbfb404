"""The table of the paper's numbers and ours, with the reason of each difference."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from sledenv.closed_forms.wheel import collide_wheel
from sledenv.reproduce import cases
from sledenv.reproduce.cases import Floats
from sledenv.reproduce.euler import FrictionSign
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.records import Feature, Status
from sledenv.simulation.rigid_impact import rigid_impact

_SIGNS: Final[tuple[FrictionSign, FrictionSign]] = ("dissipative", "printed")


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


def example_rows(example: cases.Example) -> list[Row]:
    """Numbers of the worked example: Fig. 7-10 and the conclusions that the paper draws from them."""
    exact, euler, printed = example
    t_start, t_end = cases.PRINTED_ENERGIES
    slow = 0.5 * cases.EXAMPLE_BODY.mass * cases.PRINTED_SPEED**2
    printed_half = cases.fall(sign="printed", step=cases.EULER_STEP / 2, record=False)
    printed_limit = 2.0 * printed_half.energy.kinetic - printed.energy.kinetic  # Richardson, first order
    long, long_half = (
        cases.fall(sign="printed", step=step, end=0.05, record=False)
        for step in (cases.EULER_STEP, cases.EULER_STEP / 2)
    )
    leaves = 2.0 * float(long_half.rebounds["t"][0]) - float(long.rebounds["t"][0])
    leaves_with = 2.0 * long_half.energy.kinetic - long.energy.kinetic
    elastic, elastic_printed = (
        cases.fall(sign=sign, asymmetry=0.0, end=0.05, record=False).energy.kinetic for sign in _SIGNS
    )
    rows = exact.trajectory
    touching = rows["feature"] != Feature.NONE
    a, b = cases.arc_arms(exact.body, rows["phi"])
    gap_rate = rows["v"] - a * rows["omega"]
    moment = cases.force_series(exact)["moment"]
    turn = _first_crossing(rows["t"][touching], gap_rate[touching])
    reversal = _first_crossing(rows["t"][touching], moment[touching])
    slips = np.unique(rows["slip"][touching])
    complete = len(slips) == 1 and slips[0] != 0
    spins = np.unique(rows["spin"][touching])
    depth = float(np.max(b[touching] - rows["y"][touching]))
    size = cases.EXAMPLE_BODY.radius**2 - cases.EXAMPLE_BODY.eccentricity**2
    rigid = rigid_impact(cases.EXAMPLE_BODY, cases.EXAMPLE_LAW, cases.EXAMPLE_LAUNCH)
    lost = rigid.loss_hysteresis + rigid.loss_sliding + rigid.loss_rolling
    gone = "printed sign of friction in (10), which creates energy (docs/physics.md, section 2.1)"
    where = "worked example, Fig. 10"
    return [
        Row("t0_printed_speed", where, f"T(0) with V_y = {cases.PRINTED_SPEED:g} m/s", "J", f"{t_start:g}", slow, ".4f",
            "the printed speed does not give the printed energy"),
        Row("speed", where, "speed V_y that gives it", "m/s", f"{cases.PRINTED_SPEED:g}",
            -math.sqrt(2.0 * t_start / cases.EXAMPLE_BODY.mass), ".4f", "its square gives the energy"),
        Row("t0", where, f"T(0) with V_y = {cases.EXAMPLE_LAUNCH.v:g} m/s", "J", f"{t_start:g}",
            exact.energy.initial, ".4f", "what the runs below begin with"),
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
            f"of a radius of {cases.EXAMPLE_BODY.radius:g} m: a test of the equations, not a small deformation"),
        Row("inertia", "worked example", "m (r^2 - h^2)", "kg m^2", f"{cases.EXAMPLE_BODY.inertia:g}",
            cases.EXAMPLE_BODY.mass * size, ".6f", "equal: the body is a thin arc, not a lamina"),
        Row("t_rigid", where, "T after the impact in the limit of infinite stiffness", "J", "",
            t_start - lost, ".4f", "docs/physics.md, section 4"),
        Row("ledger", where, "energy unaccounted for, event-driven", "J", "", exact.energy.residual, ".0e",
            "the error of the integration"),
    ]  # fmt: skip


def _not_reproduced(ours: float) -> str:
    paper = cases.PRINTED_ENERGIES[1]
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


def wheel_rows(straight: Descent, oblique: Mapping[str, Descent]) -> list[Row]:
    """Numbers of the wheel: equation (1), Fig. 2 and 4; where the paper has formulas, ours are integrals."""
    m, v0, law = cases.DISC.mass, -straight.launch.v, straight.law
    rows = straight.trajectory[straight.trajectory["feature"] != Feature.NONE]
    turn = int(np.argmax(rows["v"] >= 0.0))
    first, second = (float(np.trapezoid(part["normal"], part["t"])) for part in (rows[: turn + 1], rows[turn:]))
    lasts = rows["t"][turn] - rows["t"][0], rows["t"][-1] - rows["t"][turn]
    given = f"m = {m:g} kg, V0 = {v0:g} m/s"
    found = [
        Row("sn_1", "equation (1), Fig. 2", f"impulse SNI of the first phase, {given}", "N s", f"m V0 = {m * v0:g} N s",
            first, ".4f", "confirmed" if math.isclose(first, m * v0, rel_tol=1e-4) else "not confirmed"),
        Row("sn_2", "equation (1), Fig. 2", f"impulse SNII of the second phase, R = {law.restitution:.4f}", "N s",
            f"R SNI = {law.restitution * m * v0:.4f} N s", second, ".4f", "R of the two stiffnesses, (12) and (13)"),
        Row("v_1", "equation (1)", "velocity V1 after the impact", "m/s", f"R V0 = {law.restitution * v0:.4f} m/s",
            straight.state.v, ".4f", ""),
        Row("tau_1", "Fig. 2", "duration of the first phase", "ms", "", 1e3 * lasts[0], ".4f",
            "pi/2 sqrt(m/(c (1 + Delta))): a quarter of an oscillation"),
        Row("tau_2", "Fig. 2", "duration of the second phase", "ms", "", 1e3 * lasts[1], ".4f",
            "pi/2 sqrt(m/(c (1 - Delta))): longer by 1/R"),
    ]  # fmt: skip
    for phase, run in oblique.items():
        rows, u0 = run.trajectory, run.launch.u
        stop = float(rows["t"][np.argmax((rows["slip"] == 0) & (rows["feature"] != Feature.NONE))])
        impulse = float(np.trapezoid(rows["tangential"], rows["t"]))
        closed = collide_wheel(
            m, cases.DISC.inertia, cases.DISC.radius, law.friction, law.rolling_arm, law.restitution, u0, -v0
        )  # fmt: skip
        during = "first" if stop <= lasts[0] else "second"
        found += [
            Row(f"stop_{phase}", "Fig. 4", f"sliding stops, u0 = {u0:g} m/s", "ms", f"in the {phase} phase",
                1e3 * stop, ".4f", f"in the {during} phase, u0 chosen for it; the paper draws it without numbers"),
            Row(f"sf_{phase}", "Fig. 4, equation (2)", f"tangential impulse SF, u0 = {u0:g} m/s", "N s", "", impulse,
                ".5f", f"{closed.scenario}; Table 1, corrected: {float(closed.tangential_impulse):.5f} N s"),
        ]  # fmt: skip
    return found


def jam_rows(maps: Mapping[str, DescentBatch]) -> list[Row]:
    """Numbers of the map of jamming over orientation and spin at the launch."""
    found = []
    for i, (name, batch) in enumerate(maps.items()):
        where = f"map of jamming, {name}"
        share = 100.0 * float(np.mean(batch.status != Status.FINISH))
        why = f"{len(batch.status)} launches, f = {cases.JAM_FRICTIONS[name]:g}; the paper announces no numbers"
        found += [
            Row(f"jam_ends_{i}", where, "launches that do not reach the end", "%", "", share, ".1f", why),
            Row(f"jam_mean_{i}", where, "mean jam index", "-", "", float(batch.jam.jam_index.mean()), ".3f",
                "1 - reward: docs/environments.md"),
            Row(f"jam_least_{i}", where, "least jam index", "-", "", float(batch.jam.jam_index.min()), ".3f", ""),
        ]  # fmt: skip
    return found


def table_1_rows() -> list[Row]:
    """Numbers about Table 1: how often its printed rules tell the scenarios apart, and what its signs do."""
    rng = np.random.default_rng(cases.SEED)
    draws = rng.random((6, cases.SAMPLES))
    first, second = (_rule_counts(*_drawn(draws, wide)) for wide in (False, True))
    f, restitution, arm, inertia, ratio = _drawn(draws, False)
    _, corrected = cases.printed_rules(ratio, f, restitution, arm, inertia)
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
    printed, corrected = cases.printed_rules(ratio, friction, restitution, arm, inertia)
    return float(np.mean(printed.sum(axis=0) > 1)), float(np.mean(corrected.sum(axis=0) == 1))


def sled_rows(descent: Descent) -> list[Row]:
    """Numbers of the sled: Fig. 12-14."""
    assumed = " ".join(cases.SLED_ASSUMED.split())
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
