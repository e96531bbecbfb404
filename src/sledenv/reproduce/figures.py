"""The figures of the reproduction, each with the data that it shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from sledenv.closed_forms.wheel import collide_wheel
from sledenv.machine.files import write_csv
from sledenv.plot import (
    plot_impact_phases,
    plot_jam_map,
    plot_mode_map,
    plot_sliding_end,
    plot_strobe,
    plot_table_1,
    plot_velocities,
    plot_worked_example,
)
from sledenv.reproduce import cases
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.records import Feature, Status
from sledenv.simulation.rigid_impact import rigid_impact
from sledenv.simulation.scene import State
from sledenv.simulation.words import mode_name

_DPI = 150
_SLED_GIVEN = "Given in the paper: 100 kg, friction 0.03, restitution 0.5."


def write_worked_example(folder: Path, example: cases.Example) -> None:
    """Fig. 7-10."""
    signs = cases.SIGNS[0], *cases.SIGNS
    labels = (
        "event-driven, dissipative friction sign",
        f"Euler, Δt = {1e6 * cases.EULER_STEP:g} µs, the same sign",
        "Euler, printed friction sign (creates energy)",
    )
    runs = {label: cases.force_series(run, sign) for label, run, sign in zip(labels, example, signs, strict=True)}
    figure = plot_worked_example(runs, paper=(cases.EXAMPLE_END, cases.PRINTED_ENERGIES[1]))
    figure.savefig(folder / "fig_7_10.png", dpi=_DPI)
    keys = ("event-driven", "euler", "euler-printed-sign")
    write_csv(
        folder / "fig_7_10.csv",
        ("run", "t_s", "normal_n", "tangential_n", "moment_n_m", "kinetic_j"),
        ((key, *row) for key, rows in zip(keys, runs.values(), strict=True) for row in rows.tolist()),
    )


def write_sled(folder: Path, descent: Descent) -> None:
    """Fig. 11 and Fig. 12-14."""
    note = f"{_SLED_GIVEN}\n{cases.SLED_ASSUMED}"
    plot_strobe(descent).savefig(folder / "fig_11.png", dpi=_DPI)
    plot_velocities(descent, note=note, paper=True).savefig(folder / "fig_12_14.png", dpi=_DPI)
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


def write_table_1(folder: Path) -> None:
    """Table 1 as a map."""
    ratio, friction = cases.middles(0.0, 1.2, 160), cases.middles(0.0, 0.6, 125)  # no cell lies on a border
    u, f = np.meshgrid(ratio, friction)
    e, inertia, arm = cases.WHEEL_RESTITUTION, cases.WHEEL_INERTIA, cases.WHEEL_ARM
    scenario = collide_wheel(1.0, inertia, 1.0, f, arm, e, u, -1.0).scenario.astype(str)
    held, _ = cases.printed_rules(u, f, np.array(e), np.array(arm), np.array(inertia))
    rows = [" + ".join(str(row + 1) for row in np.flatnonzero(cell)) for cell in held.reshape(4, -1).T]
    printed = np.array(rows).reshape(u.shape)
    note = (
        f"Uniform disc without spin: J = {cases.WHEEL_INERTIA:g} m r², R = {cases.WHEEL_RESTITUTION:g}, "
        f"rolling arm δ = {cases.WHEEL_ARM:g} r (assumed). Numbers are the rows of Table 1."
    )
    plot_table_1(ratio, friction, scenario, printed, note=note).savefig(folder / "table_1.png", dpi=_DPI)
    write_csv(
        folder / "table_1.csv",
        ("speed_ratio", "friction", "scenario", "printed_rules"),
        zip(*(column.ravel().tolist() for column in (u, f, scenario, printed)), strict=True),
    )


def write_mode_map(folder: Path) -> None:
    """How an impact of the eccentric body ends, as a map."""
    degrees, ratio = cases.middles(-180.0, 180.0, 240), cases.middles(-2.0, 2.0, 160)
    panels, lines = {}, []
    for friction, arm, restitution in cases.MODE_LAWS:
        law = cases.EXAMPLE_LAW._replace(friction=friction, rolling_arm=arm)
        modes = np.zeros((len(ratio), len(degrees)), dtype=int)
        for i, speed in enumerate(ratio.tolist()):
            for j, angle in enumerate(degrees.tolist()):
                state = State(0.0, 0.0, math.radians(angle), speed, -1.0, 0.0)
                mode = rigid_impact(cases.EXAMPLE_BODY, law, state, restitution=restitution).mode
                modes[i, j] = mode
                lines.append((friction, arm, restitution, angle, speed, mode_name(mode)))
        panels[f"f = {friction:g}, δ = {1e3 * arm:g} mm, e = {restitution:.3g}"] = modes
    note = "How one rigid impact ends: the body of the worked example, without spin at touch."
    plot_mode_map(np.radians(degrees), ratio, panels, note=note).savefig(folder / "mode_map.png", dpi=_DPI)
    columns = "friction", "rolling_arm_m", "restitution", "phi_deg", "speed_ratio", "mode"
    write_csv(folder / "mode_map.csv", columns, lines)


def write_wheel(folder: Path, straight: Descent, oblique: Mapping[str, Descent]) -> None:
    """Fig. 2 and Fig. 4."""
    wheel = "Uniform disc (assumed), V0 = 1 m/s; mass, radius, stiffness and friction of the worked example."
    plot_impact_phases(straight, note=wheel).savefig(folder / "fig_2.png", dpi=_DPI)
    titles = {f"u0 = {run.launch.u:g} m/s: stops in the {phase} phase": run for phase, run in oblique.items()}
    plot_sliding_end(titles, note=wheel).savefig(folder / "fig_4.png", dpi=_DPI)
    write_csv(
        folder / "fig_2_4.csv",
        ("u0_m_s", "t_s", "normal_n", "tangential_n", "slip_sign"),
        (
            (run.launch.u, *row)
            for run in (straight, *oblique.values())
            for row in run.trajectory[["t", "normal", "tangential", "slip"]].tolist()
        ),
    )


def write_jam_map(folder: Path, maps: Mapping[str, DescentBatch]) -> None:
    """Jamming over orientation and spin at the launch."""
    degrees, spin = cases.middles(*cases.JAM_ORIENTATIONS), cases.middles(*cases.JAM_SPINS)
    shape = len(spin), len(degrees)
    panels, lines = {}, []
    for name, batch in maps.items():
        friction = cases.JAM_FRICTIONS[name]
        jam, finished = batch.jam.jam_index.reshape(shape), (batch.status == Status.FINISH).reshape(shape)
        panels[f"f = {friction:g}: {name}"] = jam, finished
        columns = zip(batch.jam.jam_index.tolist(), batch.status.tolist(), strict=True)
        launches = ((angle, omega) for omega in spin.tolist() for angle in degrees.tolist())
        lines += [(friction, *launch, *ends) for launch, ends in zip(launches, columns, strict=True)]
    note = f"{_SLED_GIVEN}\n{cases.SLED_ASSUMED}\nThe map varies orientation and spin."
    mark = cases.SLED_PHI, 0.0, "the launch of Fig. 11-14"
    plot_jam_map(np.radians(degrees), spin, panels, mark=mark, note=note).savefig(folder / "jam_map.png", dpi=_DPI)
    write_csv(folder / "jam_map.csv", ("friction", "phi_deg", "spin_rad_s", "jam_index", "status"), lines)
