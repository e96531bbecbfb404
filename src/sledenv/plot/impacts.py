"""Impacts by their impulses: one in the impulse plane, all of a descent over time, and the states between them."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.style import BLUE, DASHES, GREEN, INK, RED, SHADE, WIDTH, contact_key, shade_contacts, styled
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rigid_impact import Hypothesis, rigid_impact
from sledenv.simulation.scene import ContactLaw, State
from sledenv.simulation.support import arms_beside, lowest_arms, within_a_turn
from sledenv.simulation.words import mode_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SLIPS = {1: (RED, "slips downhill"), -1: (BLUE, "slips uphill"), 0: (GREEN, "sticks")}  # by the sign of the slip
_ON_A_CURVE = 64  # points of the curve of a flight


def plot_impulse_plane(
    body: Body,
    law: ContactLaw,
    state: State,
    *,
    restitution: float | None = None,
    hypothesis: Hypothesis = "energetic",
) -> Figure:
    """Plot one rigid impact in the impulse plane: tangential over normal impulse, with the cone of friction.

    Parameters
    ----------
    body, law, state, restitution, hypothesis
        As for :func:`sledenv.rigid_impact`.

    Returns
    -------
    Figure
        The path has one straight piece for each phase: parallel to an edge of the cone where the body slips, flatter
        where it sticks.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    TypeError, ValueError, ArithmeticError
        As :func:`sledenv.rigid_impact`, and ValueError if the body does not approach the slope.
    """
    impact = rigid_impact(body, law, state, restitution=restitution, hypothesis=hypothesis)
    if not impact.phases:
        raise ValueError(f"state = {state}: the body does not approach the slope, so there is no impact to draw")
    path = [(0.0, 0.0)]
    for phase in impact.phases:
        ratio = _force_ratio(body, law, state.phi, phase.slip, phase.spin)
        path.append((path[-1][0] + phase.impulse, path[-1][1] + ratio * phase.impulse))
    p, q = np.array(path).T
    widest = 1.08 * impact.normal_impulse
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        figure = Figure(figsize=(WIDTH, 5.0), layout="constrained")
        ax = figure.subplots()
        edge = law.friction * widest
        ax.fill([0.0, widest, widest], [0.0, edge, -edge], color=SHADE, lw=0.0, zorder=0)
        ax.plot([widest, 0.0, widest], [edge, 0.0, -edge], color=INK, lw=0.8, ls=DASHES)
        ax.axhline(0.0, color=INK, lw=0.6)
        for i, phase in enumerate(impact.phases):
            ax.plot(p[i : i + 2], q[i : i + 2], color=_SLIPS[phase.slip][0], lw=2.4, solid_capstyle="round")
        events = []
        for i, words in enumerate(_turns(impact.phases), start=1):
            ax.plot(p[i], q[i], color=INK, marker="o", ms=12.0, mfc="white", mew=0.8)
            ax.text(p[i], q[i], str(i), ha="center", va="center_baseline", fontsize=8.0)
            events.append(Line2D([], [], ls="", color=INK, marker=f"${i}$", ms=6.0, label=words))
        ax.legend(handles=events, loc="lower right" if q[-1] > 0.0 else "upper right")  # where the path leaves room
        ax.set_xlim(0.0, widest)
        high = max(1.25 * float(np.abs(q).max()), 0.2 * edge, 1e-3 * widest)
        ax.set_ylim(-high, high)
        ax.set_xlabel("normal impulse [N s]")
        ax.set_ylabel("tangential impulse [N s]")
        ax.set_title(f"ends as {mode_name(impact.mode)}", loc="left")
        handles: list[Artist] = [Patch(color=SHADE, label=f"cone of friction, f = {law.friction:g}")]
        shown = (_SLIPS[slip] for slip in sorted({phase.slip for phase in impact.phases}))
        handles += [Line2D([], [], color=colour, lw=2.4, label=label) for colour, label in shown]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _force_ratio(body: Body, law: ContactLaw, phi: float, slip: int, spin: int) -> float:
    """Return F/N in a phase of a rigid impact: docs/physics.md, section 4.1."""
    if slip != 0:
        return -law.friction * slip
    if spin == 0:
        return 0.0
    (arc,), ((a, b),) = lowest_arms(body.record, within_a_turn(np.array([phi])))
    rolling_arm = law.corner_rolling_arm if body.record["corner"][0, arc] else law.rolling_arm
    return float(body.mass * b * (a + rolling_arm * spin) / (body.inertia + body.mass * b * b))


def _turns(phases: tuple[Any, ...]) -> list[str]:
    """Return what ends each phase."""
    words = []
    for one, after in pairwise(phases):
        changes = []
        if one.slip != after.slip:
            changes.append("sliding stops" if after.slip == 0 else "slip turns" if one.slip else "sliding starts")
        if one.spin != after.spin:
            changes.append("rotation stops" if after.spin == 0 else "spin turns" if one.spin else "rotation starts")
        if one.restitution != after.restitution:
            changes.append("compression ends" if after.restitution else "compressed again")
        words.append(", ".join(changes))
    return [*words, "separation"]


def plot_impulses(descent: Descent) -> Figure:
    """Plot the impulses of all contacts of a descent over time, as stems; rigid impacts have no other history.

    Parameters
    ----------
    descent : Descent
        With a rebound at least; it needs no trajectory.

    Returns
    -------
    Figure
        Normal impulse, on a logarithmic scale; tangential impulse over its bound, SF/(f SN) in [-1, 1], where a contact
        that crosses zones has the largest of their f. Contacts that last are shaded, and their stems, at their ends,
        are hollow.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there is no rebound with a normal impulse.
    """
    log = descent.rebounds
    log = log[log["normal_impulse"] > 0.0]
    if len(log) == 0:
        raise ValueError("the descent has no rebounds: there is nothing to draw")
    bound = np.array([_largest_friction(descent, row) for row in log]) * log["normal_impulse"]
    share = np.divide(log["tangential_impulse"], bound, out=np.zeros(len(log)), where=bound > 0.0)
    lasting = log["duration"] > 0.0
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D

        figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
        axes: list[Axes] = list(figure.subplots(2, 1, sharex=True))
        least = 10.0 ** math.floor(math.log10(0.8 * float(log["normal_impulse"].min())))
        panels = ((log["normal_impulse"], BLUE, least), (share, RED, 0.0))
        for ax, (values, colour, floor) in zip(axes, panels, strict=True):
            shade_contacts(ax, descent, 1.0)
            ax.vlines(log["t"], floor, values, color=colour, lw=1.4)
            ax.plot(log["t"][~lasting], values[~lasting], color=colour, marker="o", ms=5.0, ls="")
            ax.plot(log["t"][lasting], values[lasting], color=colour, marker="o", ms=5.0, mfc="white", ls="")
        axes[0].set_yscale("log")
        axes[0].set_ylim(bottom=least)
        axes[0].set_ylabel("normal impulse\nSN [N s]")
        axes[1].axhline(0.0, color=INK, lw=0.6)
        for level in (-1.0, 1.0):
            axes[1].axhline(level, color=INK, lw=0.8, ls=DASHES)
        axes[1].set_ylim(-1.15, 1.15)
        axes[1].set_ylabel("tangential impulse\nSF/(f SN) [-]")
        axes[1].set_xlabel("time [s]")
        axes[1].set_xlim(0.0, max(descent.time, float(log["t"][-1])) * 1.02)
        marks: dict[str, Any] = {"color": INK, "marker": "o", "ms": 5.0, "ls": ""}
        handles = [
            Line2D([], [], label="impact", **marks),
            Line2D([], [], mfc="white", label="contact that lasts, at its end", **marks),
            contact_key(),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        figure.align_ylabels(axes)
    return figure


def _largest_friction(descent: Descent, rebound: np.void) -> float:
    """Largest friction [-] of the places where a contact has been."""
    places = [float(rebound["x_contact"])]
    if rebound["duration"] > 0.0:
        ends = rebound["x"] - arms_beside(descent.body, float(rebound["phi"]))[:, 0]
        low, high = min(places[0], *ends), max(places[0], *ends)
        borders = [border for zone in descent.slope.zones for border in zone[:2] if low < border < high]
        places += [low, high, *borders]
    return float(descent.slope.friction_at(np.array(places), descent.law.friction).max())


def plot_phase_portraits(descent: Descent) -> Figure:
    """Plot the states before and after successive contacts: spin over orientation, and the velocity of the mass centre.

    Parameters
    ----------
    descent : Descent
        With a rebound at least; it needs no trajectory.

    Returns
    -------
    Figure
        On the left (phi, omega), on the right (u, v). Hollow before a contact, full after it, numbered by their colour;
        thin lines are flights, which keep the spin and change the velocity by gravity.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If there is no rebound.
    """
    log = descent.rebounds
    if len(log) == 0:
        raise ValueError("the descent has no rebounds: there is nothing to draw")
    begin = log["t_touchdown"]
    left_at = np.concatenate([[0.0], log["t"][:-1]])
    left_with = np.concatenate([[descent.launch.phi], log["phi"][:-1]])
    touching = left_with + log["omega_before"] * (begin - left_at)  # the spin is constant in flight
    with styled():
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D
        from matplotlib.ticker import MaxNLocator, MultipleLocator

        figure = Figure(figsize=(WIDTH, 4.8), layout="constrained")
        angles, speeds = figure.subplots(1, 2)
        number = ScalarMappable(Normalize(1.0, max(len(log), 2)), "viridis")
        for i, row in enumerate(log):
            colour = number.to_rgba(np.array(i + 1.0))
            turning = np.linspace(left_with[i], touching[i], _ON_A_CURVE)
            degrees = np.degrees(within_a_turn(turning))
            degrees[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan  # once around
            angles.plot(degrees, np.full(_ON_A_CURVE, row["omega_before"]), color=INK, lw=0.5, alpha=0.6)
            start = descent.launch[3:5] if i == 0 else (log["u_after"][i - 1], log["v_after"][i - 1])
            speeds.plot([start[0], row["u_before"]], [start[1], row["v_before"]], color=INK, lw=0.5, alpha=0.6)
            ends = np.degrees(within_a_turn(np.array([touching[i], row["phi"]])))
            pairs = ((angles, ends, "omega"), (speeds, (row["u_before"], row["u_after"]), "v"))
            for ax, (x0, x1), rate in pairs:
                y0, y1 = row[f"{rate}_before"], row[f"{rate}_after"]
                if abs(x1 - x0) < 180.0:
                    ax.plot([x0, x1], [y0, y1], color=colour, lw=1.2)
                ax.plot(x0, y0, color=colour, marker="o", ms=6.0, mfc="white")
                ax.plot(x1, y1, color=colour, marker="o", ms=6.0)
        if np.ptp(angles.get_xlim()) > 180.0:
            angles.set_xlim(-180.0, 180.0)
            angles.xaxis.set_major_locator(MultipleLocator(90.0))
        angles.set_xlabel("orientation $\\varphi$ [deg]")
        angles.set_ylabel("spin $\\omega$ [rad/s]")
        speeds.set_xlabel("u [m/s], along the slope")
        speeds.set_ylabel("v [m/s], normal to it")
        for ax in (angles, speeds):
            ax.axhline(0.0, color=INK, lw=0.6, zorder=0)
        figure.colorbar(
            number, ax=[angles, speeds], label="contact", ticks=MaxNLocator(integer=True), aspect=30, pad=0.02
        )
        marks: dict[str, Any] = {"color": INK, "marker": "o", "ms": 6.0, "ls": ""}
        handles = [
            Line2D([], [], mfc="white", label="before", **marks),
            Line2D([], [], label="after", **marks),
            Line2D([], [], color=INK, lw=0.5, label="flight"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure
