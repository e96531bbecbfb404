"""One impact of rigid surfaces by its impulses."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.style import BLUE, DASHES, GREEN, INK, RED, SHADE, WIDTH, styled
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis, rigid_impact
from sledenv.simulation.scene import ContactLaw, State
from sledenv.simulation.support import lowest_arms, within_a_turn
from sledenv.simulation.words import mode_name

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

_SLIPS = {1: (RED, "slips downhill"), -1: (BLUE, "slips uphill"), 0: (GREEN, "sticks")}  # by the sign of the slip


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
