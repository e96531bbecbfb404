"""The paper's numbers, each beside ours with the reason why they differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from sledenv.closed_forms.wheel import collide_wheel
from sledenv.reproduce import cases
from sledenv.reproduce.cases import Floats
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.records import Feature, Status
from sledenv.simulation.rigid_impact import rigid_impact


class Claim(NamedTuple):
    """A number of the paper, or one that it leaves open."""

    id: str
    where: str  # in the paper
    quantity: str
    unit: str
    paper: str  # as printed, empty where the paper has no number
    form: str  # in which table.md shows ours
    why: str  # they differ, or what it means


_WHEEL, _EXAMPLE, _SLED = "equation (1), Fig. 2", "worked example, Fig. 10", "Fig. 12-14"
_DIFFERS = "26.43 J not reproducible"
_GONE = f"printed sign of friction in (10), which creates energy (docs/physics.md, section 2.1); {_DIFFERS}"
_CHOSEN = "u0 chosen for it; the paper draws it without numbers"
_RANGES = "f, R in [0, 1], delta/r in [0, 0.5], J/(m r^2) in [0.3, 1], u0, v0 in [0, 5] m/s, uniform"

CLAIMS: Final = (
    Claim("sn_1", _WHEEL, "impulse SNI of the first phase, m = 1 kg, V0 = 1 m/s", "N s", "m V0 = 1 N s", ".4f",
          "confirmed"),
    Claim("sn_2", _WHEEL, "impulse SNII of the second phase, R = 0.5774", "N s", "R SNI = 0.5774 N s", ".4f",
          "R of the two stiffnesses, (12) and (13)"),
    Claim("v_1", "equation (1)", "velocity V1 after the impact", "m/s", "R V0 = 0.5774 m/s", ".4f", ""),
    Claim("tau_1", "Fig. 2", "duration of the first phase", "ms", "", ".4f",
          "pi/2 sqrt(m/(c (1 + Delta))): a quarter of an oscillation"),
    Claim("tau_2", "Fig. 2", "duration of the second phase", "ms", "", ".4f",
          "pi/2 sqrt(m/(c (1 - Delta))): longer by 1/R"),
    Claim("stop_first", "Fig. 4", "sliding stops, u0 = 0.15 m/s", "ms", "in the first phase", ".4f", _CHOSEN),
    Claim("sf_first", "Fig. 4, equation (2)", "tangential impulse SF, u0 = 0.15 m/s", "N s", "", ".5f",
          "stop-roll; Table 1, corrected, gives the same"),
    Claim("stop_second", "Fig. 4", "sliding stops, u0 = 0.35 m/s", "ms", "in the second phase", ".4f", _CHOSEN),
    Claim("sf_second", "Fig. 4, equation (2)", "tangential impulse SF, u0 = 0.35 m/s", "N s", "", ".5f",
          "stop-roll; Table 1, corrected, gives the same"),
    Claim("t0_printed_speed", _EXAMPLE, "T(0) with V_y = -1 m/s", "J", "50", ".4f",
          "the printed speed does not give the printed energy"),
    Claim("speed", _EXAMPLE, "speed V_y that gives it", "m/s", "-1", ".4f", "its square gives the energy"),
    Claim("t0", _EXAMPLE, "T(0) with V_y = -10 m/s", "J", "50", ".4f", "what the runs below begin with"),
    Claim("t_end_euler", _EXAMPLE, "T(0.04 s), Euler, dissipative sign", "J", "26.43", ".4f", _DIFFERS),
    Claim("t_end_limit", _EXAMPLE, "T(0.04 s), time step to 0, dissipative sign", "J", "26.43", ".4f",
          f"event-driven; {_DIFFERS}"),
    Claim("t_end_euler_printed", _EXAMPLE, "T(0.04 s), Euler, printed sign", "J", "26.43", ".4f", _GONE),
    Claim("t_end_limit_printed", _EXAMPLE, "T(0.04 s), time step to 0, printed sign", "J", "26.43", ".4f",
          f"extrapolated from two time steps; still in contact at 0.04 s; {_DIFFERS}"),
    Claim("t_separation_euler_printed", _EXAMPLE, "T after separation, Euler, printed sign", "J", "", ".4f",
          "the paper's 26.43 J is not this either"),
    Claim("separation_printed", _EXAMPLE, "separation with the printed sign", "s", "", ".4f",
          "later than the 0.04 s for which the paper gives its energy"),
    Claim("t_separation_printed", _EXAMPLE, "T after separation, time step to 0, printed sign", "J", "", ".4f",
          "extrapolated likewise"),
    Claim("separation", _EXAMPLE, "separation with the dissipative sign", "s", "", ".4f",
          "the duration of the impact for the given stiffness"),
    Claim("elastic_printed", "equation (10)", "T after the impact with Delta = 0, printed sign", "J", "", ".2f",
          "more than the 50 J that it began with: the printed sign creates energy"),
    Claim("elastic", "equation (10)", "T after the impact with Delta = 0, dissipative sign", "J", "", ".2f",
          "friction and rolling resistance take the rest"),
    Claim("slip_directions", "Fig. 8", "directions of slip during contact", "-", "1", ".0f",
          "complete sliding confirmed"),
    Claim("compression_ends", "Fig. 9", "end of the first phase", "s", "", ".4f", "gap rate zero"),
    Claim("moment_reverses", "Fig. 9", "reversal of the total moment", "s", "in the first phase", ".4f",
          "during restitution, not in the first phase"),
    Claim("spin_directions", "Fig. 9", "directions of spin, thus of rolling resistance", "-", "2", ".0f",
          "rolling resistance does not change its direction"),
    Claim("depth", _EXAMPLE, "greatest penetration", "m", "", ".4f",
          "of a radius of 0.1 m: a test of the equations, not a small deformation"),
    Claim("inertia", "worked example", "m (r^2 - h^2)", "kg m^2", "0.0075", ".6f",
          "equal: the body is a thin arc, not a lamina"),
    Claim("t_rigid", _EXAMPLE, "T after the impact in the limit of infinite stiffness", "J", "", ".4f",
          "docs/physics.md, section 4"),
    Claim("ledger", _EXAMPLE, "energy unaccounted for, event-driven", "J", "", ".0e", "the error of the integration"),
    Claim("printed_overlap", "Table 1", "inputs for which several printed rules hold", "%", "", ".1f",
          f"the share depends on the inputs, here {_RANGES}"),
    Claim("printed_overlap_unit", "Table 1", "the same with all six uniform in [0, 1]", "%", "", ".1f",
          "the share depends on the inputs"),
    Claim("corrected_unique", "Table 1", "inputs for which exactly one corrected rule holds", "%", "", ".4f",
          "docs/physics.md, section 3"),
    Claim("closed_form_agrees", "Table 1", "inputs for which the closed form names that scenario", "%", "", ".4f",
          "sledenv.collide_wheel"),
    Claim("scenario_2_printed", "equations (2), (3), Table 1", "tangential energy after scenario 2 over before", "-",
          "", ".4f", "printed signs, J = m r^2/2, delta = 0: energy out of nothing"),
    Claim("sled_status", _SLED, "how the descent ends", "-", "", "", " ".join(cases.SLED_ASSUMED.split())),
    Claim("sled_time", _SLED, "its duration", "s", "", ".3f", "the paper prints no numbers"),
    Claim("sled_rebounds", _SLED, "rebounds", "-", "", ".0f", "impacts that ended before the descent did"),
    Claim("sled_speed", _SLED, "speed along the slope at the end", "m/s", "", ".3f", ""),
    Claim("sled_spin", _SLED, "greatest spin", "rad/s", "", ".3f", ""),
    *(
        claim
        for i, (name, friction) in enumerate(cases.JAM_FRICTIONS.items())
        for claim in (
            Claim(f"jam_ends_{i}", f"map of jamming, {name}", "launches that do not reach the end", "%", "", ".1f",
                  f"f = {friction:g}; the paper announces no numbers"),
            Claim(f"jam_mean_{i}", f"map of jamming, {name}", "mean jam index", "-", "", ".3f",
                  "1 - reward: docs/environments.md"),
            Claim(f"jam_least_{i}", f"map of jamming, {name}", "least jam index", "-", "", ".3f", ""),
        )
    ),
)  # fmt: skip


def of_wheel(straight: Descent, oblique: Mapping[str, Descent]) -> dict[str, float]:
    """Return ours of the wheel; where the paper has formulas, they are integrals."""
    rows = straight.trajectory[straight.trajectory["feature"] != Feature.NONE]
    turn = int(np.argmax(rows["v"] >= 0.0))
    found = {
        "sn_1": float(np.trapezoid(rows["normal"][: turn + 1], rows["t"][: turn + 1])),
        "sn_2": float(np.trapezoid(rows["normal"][turn:], rows["t"][turn:])),
        "v_1": straight.state.v,
        "tau_1": 1e3 * float(rows["t"][turn] - rows["t"][0]),
        "tau_2": 1e3 * float(rows["t"][-1] - rows["t"][turn]),
    }
    for phase, run in oblique.items():
        rows = run.trajectory
        found[f"stop_{phase}"] = 1e3 * float(rows["t"][np.argmax((rows["slip"] == 0) & (rows["feature"] != 0))])
        found[f"sf_{phase}"] = float(np.trapezoid(rows["tangential"], rows["t"]))
    return found


def of_example(example: cases.Example) -> dict[str, float]:
    """Return ours of the worked example: Fig. 7-10 and what the paper concludes from them."""
    exact, euler, printed = example
    half = cases.EULER_STEP / 2
    end, end_half = printed, cases.fall(sign="printed", step=half, record=False)
    left, left_half = (
        cases.fall(sign="printed", step=step, end=0.05, record=False) for step in (cases.EULER_STEP, half)
    )
    elastic = {
        sign: cases.fall(sign=sign, asymmetry=0.0, end=0.05, record=False).energy.kinetic for sign in cases.SIGNS
    }
    rows = exact.trajectory[exact.trajectory["feature"] != Feature.NONE]
    a, b = cases.arc_arms(exact.body, rows["phi"])
    moment = cases.force_series(exact)["moment"][exact.trajectory["feature"] != Feature.NONE]
    body, launch = cases.EXAMPLE_BODY, cases.EXAMPLE_LAUNCH
    rigid = rigid_impact(body, cases.EXAMPLE_LAW, launch)
    return {
        "t0_printed_speed": 0.5 * body.mass * cases.PRINTED_SPEED**2,
        "speed": -math.sqrt(2.0 * cases.PRINTED_ENERGIES[0] / body.mass),
        "t0": exact.energy.initial,
        "t_end_euler": euler.energy.kinetic,
        "t_end_limit": exact.energy.kinetic,
        "t_end_euler_printed": printed.energy.kinetic,
        # Richardson's extrapolation of a method of first order.
        "t_end_limit_printed": 2.0 * end_half.energy.kinetic - end.energy.kinetic,
        "t_separation_euler_printed": left.energy.kinetic,
        "separation_printed": float(2.0 * left_half.rebounds["t"][0] - left.rebounds["t"][0]),
        "t_separation_printed": 2.0 * left_half.energy.kinetic - left.energy.kinetic,
        "separation": float(exact.rebounds["t"][0]),
        "elastic_printed": elastic["printed"],
        "elastic": elastic["dissipative"],
        "slip_directions": float(len(np.unique(rows["slip"]))),
        "compression_ends": _first_crossing(rows["t"], rows["v"] - a * rows["omega"]),
        "moment_reverses": _first_crossing(rows["t"], moment),
        "spin_directions": float(len(np.unique(rows["spin"]))),
        "depth": float(np.max(b - rows["y"])),
        "inertia": body.mass * (body.radius**2 - body.eccentricity**2),
        "t_rigid": exact.energy.initial - rigid.loss_hysteresis - rigid.loss_sliding - rigid.loss_rolling,
        "ledger": exact.energy.residual,
    }


def _first_crossing(t: Floats, values: Floats) -> float:
    """First time at which ``values`` change their sign, by linear interpolation; inf if they do not."""
    signs = np.sign(values)
    nonzero = np.flatnonzero(signs)
    change = np.flatnonzero(signs[nonzero][1:] != signs[nonzero][:-1])
    if change.size == 0:
        return math.inf
    i, j = nonzero[change[0]], nonzero[change[0] + 1]
    return float(t[i] - values[i] * (t[j] - t[i]) / (values[j] - values[i]))


def of_table_1() -> dict[str, float]:
    """Return ours of Table 1: how often its printed rules tell the scenarios apart, and what its signs do."""
    f, e, arm, inertia, u, v = np.random.default_rng(cases.SEED).random((6, cases.SAMPLES))
    v = 1.0 - v  # in (0, 1]
    wheel = u / v, f, e, 0.5 * arm, 0.3 + 0.7 * inertia
    printed, corrected = cases.printed_rules(*wheel)
    in_unit, _ = cases.printed_rules(u / v, f, e, arm, 1.0 - inertia)
    scenario = collide_wheel(1.0, wheel[4], 1.0, f, wheel[3], e, u / v, -1.0).scenario
    named = np.array(["slide-roll", "stop-roll", "slide", "stuck"])[np.argmax(corrected, axis=0)]
    # Scenario 2 as printed, without rolling resistance: m(u1 - u0) = SF, J w1 = -r SF, u1 + w1 r = 0, J = m r^2/2.
    u1, w1, _ = np.linalg.solve([[1.0, 0.0, -1.0], [0.0, 0.5, 1.0], [1.0, 1.0, 0.0]], [1.0, 0.0, 0.0])
    return {
        "printed_overlap": 100.0 * float(np.mean(printed.sum(axis=0) > 1)),
        "printed_overlap_unit": 100.0 * float(np.mean(in_unit.sum(axis=0) > 1)),
        "corrected_unique": 100.0 * float(np.mean(corrected.sum(axis=0) == 1)),
        "closed_form_agrees": 100.0 * float(np.mean(named == scenario.astype(str))),
        "scenario_2_printed": float(u1**2 + 0.5 * w1**2),  # over u0^2 = 1
    }


def of_sled(descent: Descent) -> dict[str, float | str]:
    """Return ours of the sled, Fig. 12-14."""
    return {
        "sled_status": str(descent.status),
        "sled_time": descent.time,
        "sled_rebounds": float(np.count_nonzero(descent.rebounds["t"] < descent.time)),
        "sled_speed": descent.state.u,
        "sled_spin": float(np.max(np.abs(descent.trajectory["omega"]))),
    }


def of_jamming(maps: Mapping[str, DescentBatch]) -> dict[str, float]:
    """Return ours of the map of jamming over orientation and spin at the launch."""
    found = {}
    for i, batch in enumerate(maps.values()):
        found[f"jam_ends_{i}"] = 100.0 * float(np.mean(batch.status != Status.FINISH))
        found[f"jam_mean_{i}"] = float(batch.jam.jam_index.mean())
        found[f"jam_least_{i}"] = float(batch.jam.jam_index.min())
    return found
