"""The velocities of a descent over time, and where its energy is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from sledenv.plot.shapes import to_world
from sledenv.plot.style import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    POTENTIAL,
    PURPLE,
    RED,
    SKY,
    WIDTH,
    contact_key,
    outcome,
    shade_contacts,
    styled,
)
from sledenv.plot.trajectories import Touches, kinetic, touches_in
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import CONTACT_LOSSES, FLIGHT_LOSSES
from sledenv.simulation.scene import asymmetry_of
from sledenv.simulation.sensitivity import natural_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAST: Final = 1e-6  # of the natural units: what an axis shows at least, so that rounding looks like a straight line
_STILL: Final = 1e-9  # [m/s] rounding of the rate of a gap that turns


def plot_descent(descent: Descent, *, label: str = "") -> Figure:
    """Plot velocities (the paper's Fig. 12-14) and the energy ledger of a descent over time.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    label : str
        Put in front of its title.

    Returns
    -------
    Figure
        Velocity along the slope, velocity normal to it, angular velocity, and where the energy of the launch has gone:
        the layers add up to the same sum at all times.

    Raises
    ------
    ValueError
        If the trajectory is missing.
    """
    rows = drawable_rows(descent)
    t = rows["t"]
    layers = energy_layers(descent, rows)
    rates = natural_units(descent.body, descent.slope, descent.launch)[3:]
    curves = (("u", "u [m/s]\nalong the slope"), ("v", "v [m/s]\nnormal to it"), ("omega", "ω [rad/s]\nspin"))
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 8.0), layout="constrained")
        axes: list[Axes] = list(figure.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.9)))
        for ax, (field, unit) in zip(axes[:3], curves, strict=True):
            shade_contacts(ax, descent, 1.0)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(t, rows[field], color=BLUE)
            ax.set_ylabel(unit)
            least = _LEAST * (rates[2] if field == "omega" else max(rates[:2]))
            low, high = ax.get_ylim()
            ax.set_ylim(min(low, -least), max(high, least))
        colours = (BLUE, SKY, POTENTIAL, GREEN, RED, ORANGE, PURPLE, INK)
        axes[3].stackplot(t, list(layers.values()), labels=list(layers), colors=colours, lw=0.0)
        axes[3].set_ylabel("energy [J]")
        axes[3].set_xlabel("time [s]")
        axes[3].set_xlim(t[0], t[-1] if t[-1] > t[0] else t[0] + 1.0)
        axes[0].set_title(outcome(descent, label), loc="left")
        handles = [*axes[3].get_legend_handles_labels()[0], contact_key()]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.align_ylabels(axes)
    return figure


def energy_layers(descent: Descent, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Return where the energy [J] is in each row: moving, above the lowest place of the descent, stored or lost."""
    translation, rotation = kinetic(descent, rows)
    height = to_world(np.stack([rows["x"], rows["y"]], axis=-1), descent.slope.angle)[:, 1]
    potential = descent.body.mass * descent.slope.gravity * (height - height.min())
    touches = touches_in(descent.body, rows)
    compression, loading, _ = _springs(descent, touches)
    stored = touches.by_row(0.5 * loading * np.square(compression), rows)
    # Where a gap turns, the force of the second of two rows tells how far a spring is compressed that began inside.
    turns = np.diff(rows["t"]) == 0.0
    stored[:-1][turns] = np.minimum(stored[:-1], stored[1:])[turns]
    lost = dict(zip(CONTACT_LOSSES, _losses(descent, rows), strict=True))
    lost |= {name: rows[name] for name in FLIGHT_LOSSES if rows[name].any()}
    return {
        "translation": translation,
        "rotation": rotation,
        "potential": potential,
        "stored in the contact": stored,
        **{f"lost by {name}": energy for name, energy in lost.items()},
    }


def _springs(descent: Descent, touches: Touches) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compression [m] of each contact and its stiffness [N/m] while the gap closes and while it opens.

    It is less than the depth where a spring began to be compressed inside the ground.
    """
    x, normal = touches.forces["x"], touches.forces["normal"]
    stiffness, asymmetry = np.full(len(x), descent.law.stiffness), np.full(len(x), descent.law.asymmetry)
    for zone in descent.slope.zones:
        within = (x >= zone.begin) & (x < zone.end)
        if zone.stiffness is not None:
            stiffness[within] = zone.stiffness
        if zone.restitution is not None:
            asymmetry[within] = asymmetry_of(zone.restitution)
    loading, unloading = stiffness * (1.0 + asymmetry), stiffness * (1.0 - asymmetry)
    pressed = np.where(touches.gap_rate > -_STILL, unloading, loading)
    compression = np.divide(normal, pressed, out=np.full(len(x), np.inf), where=pressed > 0.0)
    return np.minimum(compression, touches.depth), loading, unloading


def _losses(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Cumulative losses [J] in contacts, of CONTACT_LOSSES, shape (3, m).

    The rebounds say how much each contact lost; the power of the contact forces says when. What had no force was lost
    in an impact of rigid surfaces, where the kinetic energy falls.
    """
    falls = -np.diff(sum(kinetic(descent, rows)))
    touches = touches_in(descent.body, rows)
    forces = touches.forces
    compression, loading, unloading = _springs(descent, touches)
    opens = np.maximum(touches.gap_rate, 0.0)
    power = np.stack(
        [
            touches.by_row((loading - unloading) * compression * opens, rows),
            touches.by_row(np.abs(forces["tangential"] * touches.slip_velocity), rows),
            np.abs(rows["rolling"] * rows["omega"]),
        ]
    )
    work = np.diff(rows["t"]) * 0.5 * (power[:, 1:] + power[:, :-1])
    total = np.zeros(power.shape)
    for rebound in descent.rebounds:
        begin = rebound["t_touchdown"]
        first = max(np.searchsorted(rows["t"], begin, side="right") - 1, 0)
        first = min(first, np.searchsorted(rows["t"], begin))
        last = np.searchsorted(rows["t"], rebound["t"], side="right") - 1
        losses = np.array([rebound[f"loss_{name}"] for name in CONTACT_LOSSES])
        done = np.cumsum(work[:, first:last], axis=1)
        if done.size == 0:  # an impact whose rows were left out
            total[:, last + 1 :] += losses[:, None]
            continue
        struck = np.arange(done.shape[1]) >= np.argmax(falls[first:last])
        forced = done[:, -1:] > np.maximum(0.1 * losses[:, None], 0.0)
        spread = np.divide(done, done[:, -1:], out=np.tile(1.0 * struck, (3, 1)), where=forced)
        total[:, first + 1 : last + 1] += losses[:, None] * spread
        total[:, last + 1 :] += losses[:, None]
    return total
