"""A descent in words: how it began, its rebounds one by one, how it ended."""

from __future__ import annotations

import math
from typing import Final

from sledenv.kernel.records import Mode
from sledenv.machine.text_tables import aligned
from sledenv.simulation.bodies import Body, Segment
from sledenv.simulation.jam import SHOWN
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.sensitivity import END_QUANTITIES, LAUNCH, PARAMETERS, Sensitivity
from sledenv.simulation.support import clearance

_MOST_PARTS: Final = 8  # that are named in a line


def part_name(body: Body, code: int) -> str:
    """Return the part of a body that touches, such as "arc", from its code in records; "none" in flight."""
    return body.parts[code - 1] if code else "none"


_DEEP: Final = 0.1  # of the size of the body: a penetration that is told


def mode_name(mode: int) -> str:
    """Return how a contact ended, such as "slip-reversal"."""
    return Mode(mode).name.lower().replace("_", "-")


def metric_name(metric: str) -> str:
    """Return the name of a jam metric for a reader, with its unit if it has one: "reward"."""
    unit = SHOWN[metric].unit if metric in SHOWN else ""
    return metric.replace("_", " ") + (f" [{unit}]" if unit else "")


def motion_words(slip: int, spin: int) -> str:
    """Return what a contact does at one time, from the signs of its slip and of its spin."""
    return f"{'slides' if slip else 'sticks'}, {'turns' if spin else 'does not turn'}"


def quantity(value: float, unit: str) -> str:
    """Return a quantity with three digits and, where it needs one, a prefix of its unit: "24.1 kN"."""
    size = abs(value)
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if factor <= size < 1e3 * factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:z.3g} {unit}"


def rounded(value: float) -> str:
    """Return a number with four digits: "1.650", "62730", "0"."""
    if value == 0.0:
        return "0"
    digits = f"{value:z#.4g}"
    return f"{float(digits):.0f}" if 1e4 <= abs(value) < 1e9 else digits.rstrip(".")


def setting(body: Body, law: ContactLaw, slope: Slope, launch: State) -> str:
    """Return the body, the surface, the slope and the launch, one line each."""
    clear = clearance(body, slope, launch)
    arm = f"rolling arm {law.rolling_arm:.4g} m"
    if _has_corners(body):
        arm += f" ({law.corner_rolling_arm:.4g} m at a corner)"
    length = f"length {slope.length:.4g} m" if math.isfinite(slope.length) else "without end"
    zones = "".join(f"{_zone_words(zone)}\n" for zone in slope.zones)
    air = f"air: density {slope.air_density:.4g} kg/m^3, drag area {body.drag_area:.4g} m^2\n" if body.drag_area else ""
    return (
        f"body: {_body_words(body)}\n"
        f"contact: stiffness {quantity(law.stiffness, 'N/m')}, restitution {law.restitution:.3f}, "
        f"friction {law.friction:.3f}, {arm}\n"
        f"slope: {math.degrees(slope.angle):.2f} deg, {length}, gravity {slope.gravity:.4g} m/s^2"
        f"{_profile_words(slope)}\n{air}{zones}"
        f"launch: orientation {rounded(math.degrees(launch.phi))} deg, spin {rounded(launch.omega)} rad/s, "
        f"speed {rounded(launch.u)} m/s, clearance {clear:z.3f} m, fall {rounded(0.0 - launch.v)} m/s"
    )


def _profile_words(slope: Slope) -> str:
    if not slope.profile:
        return ""
    x, y, radii = slope.vertices.T
    words = f", profile of {len(x)} vertices from {x[0]:.4g} to {x[-1]:.4g} m, heights {y.min():.4g} to {y.max():.4g} m"
    if not slope.rounding:
        return words
    low, high = radii.min(), radii.max()
    return words + (f", radius {low:.4g} m" if low == high else f", radii {low:.4g} to {high:.4g} m")


def _zone_words(zone: Zone) -> str:
    end = f"to {zone.end:.4g} m" if math.isfinite(zone.end) else "on"
    words = f"zone: from {zone.begin:.4g} m {end}, friction {zone.friction:.3g}, rolling arm {zone.rolling_arm:.4g} m"
    if zone.restitution is not None:
        words += f", restitution {zone.restitution:.3f}"
    return words if zone.stiffness is None else f"{words}, stiffness {quantity(zone.stiffness, 'N/m')}"


def _has_corners(body: Body) -> bool:
    return body.half_angle < math.pi if isinstance(body, Segment) else any(arc.corner for arc in body.arcs)


def _body_words(body: Body) -> str:
    mass, inertia = f"mass {body.mass:.4g} kg", f"inertia {body.inertia:.4g} kg m^2"
    if isinstance(body, Segment):
        corners = f"half-angle {math.degrees(body.half_angle):.4g} deg" if _has_corners(body) else "no corners"
        return f"{mass}, radius {body.radius:.4g} m, eccentricity {body.eccentricity:.4g} m, {inertia}, {corners}"
    arcs = "1 arc" if len(body.arcs) == 1 else f"{len(body.arcs)} arcs"
    parts = f"{len(body.parts)} parts" if len(body.parts) > _MOST_PARTS else f"parts: {', '.join(body.parts)}"
    return f"{mass}, {inertia}, size {body.size:.4g} m, {arcs}; {parts}"


REBOUND_HEADER = (
    "#",
    "t [s]",
    "x [m]",
    "where",
    "how it ended",
    "u [m/s]",
    "v [m/s]",
    "omega [rad/s]",
    "grip",
    "loss",
    "stuck",
)
_REBOUND_FORMS = (">3", ">8", ">8", ">5", ">15", ">15", ">15", ">17", ">5", ">5", "<")


def rebound_cells(descent: Descent) -> list[tuple[str, ...]]:
    """Return the cells of the table of rebounds, a row each, with the velocities before and after it."""
    jam = descent.rebound_jam
    rows = []
    for i, row in enumerate(descent.rebounds):
        changes = (
            f"{row[f'{name}_before']:z.2f} ->{row[f'{name}_after']:z{width}.2f}"
            for name, width in (("u", 6), ("v", 6), ("omega", 7))
        )
        stuck = "yes" if jam.stuck[i] else "nearly" if jam.nearly_stuck[i] else ""
        place = rounded(row["t"]), rounded(row["x"]), part_name(descent.body, row["feature"]), mode_name(row["mode"])
        rows.append((f"{i + 1}", *place, *changes, f"{jam.grip[i]:.2f}", f"{jam.tangential_loss[i]:.2f}", stuck))
    return rows


def rebound_table(descent: Descent) -> str:
    """Return a header and one line for each rebound."""
    lines = aligned((REBOUND_HEADER, *rebound_cells(descent)), _REBOUND_FORMS, gap=" ")
    return "\n".join(lines if len(lines) > 1 else [*lines, "    no rebounds"])


def sensitivity_table(found: Sensitivity) -> str:
    """Return what the end of a descent changes by with each parameter, and how differences grow, rebound by rebound."""
    shown = ("t", "x", "u", "omega", "reward")
    header = ("", "value", *(_named(name, END_QUANTITIES[name]) for name in shown), "less by", "more by")
    rows: list[tuple[str, ...]] = [header]
    for i, name in enumerate(found.parameters):
        derivatives = (found.of_end(quantity, name) for quantity in shown)
        mark = {-1: " <", 0: "", 1: " >"}[int(found.sides[-1, i])]
        cells = (f"{value:z.4g}" for value in (found.values[i], *derivatives, *found.distances[-1, i]))
        rows.append((_named(name, PARAMETERS[name]) + mark, *cells))
    lines = ["derivatives of the end by each parameter, and how much less or more of it changes the events:"]
    lines += aligned(rows, ("<", ">"))
    if found.sides[-1].any():
        lines.append("  < or >: holds for less, or for more, of the parameter alone")
    if set(LAUNCH) <= set(found.parameters):
        lines += ["", "growth of a small difference of the launch, and the nearest other events up to the rebound:"]
        lines += aligned(_growth_rows(found), ("<", ">"))
    return "\n".join(lines)


def _growth_rows(found: Sensitivity) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [("#", "t [s]", "x [m]", "growth", "nearest change")]
    columns = [found.parameters.index(name) for name in LAUNCH]
    for i, (rebound, growth) in enumerate(zip(found.descent.rebounds, found.growth, strict=False)):
        apart = found.distances[i, columns] / found.units[:, None]
        which, side = divmod(int(apart.argmin()), 2)
        name = LAUNCH[which]
        change = f"{name} {'+' if side else '-'} {found.distances[i, columns[which], side]:.3g} {PARAMETERS[name]}"
        nearest = change if math.isfinite(apart.min()) else "none found"
        rows.append((f"{i + 1}", rounded(rebound["t"]), rounded(rebound["x"]), f"{growth[0]:.4g}", nearest))
    return rows


def _named(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def summary(descent: Descent) -> str:
    """Return how the descent ended, its jam metrics and its energy ledger, several lines."""
    jam, energy = descent.jam, descent.energy
    ledger = [(f"  {name}", rounded(value)) for name, value in energy._asdict().items()]
    ledger.append(("  residual", f"{energy.residual:.1e}"))
    metrics = ", ".join(f"{metric_name(name)} {rounded(float(value))}" for name, value in jam._asdict().items())
    # A fall in the run-out takes back what there was at the finish.
    line = descent.at_line if descent.status == "finish" else None
    passed = "" if line is None else f", all at the finish, after {rounded(line[0])} s"
    lying = []
    if descent.on_chord is not None:
        time, x = descent.on_chord
        where = "chord      first lay on it" if isinstance(descent.body, Segment) else "side       first lay on one"
        lying.append(f"{where}, settled, after {rounded(time)} s at x = {rounded(x)} m")
    depth = float(descent.rebounds["peak_penetration"].max(initial=0.0))
    if depth > _DEEP * descent.body.size > 0.0:  # as of a stiffness in another unit
        sizes = depth / descent.body.size
        lying.append(f"depth      pressed in by {depth:.4g} m, {sizes:.2g} times the size of the body: a soft surface")
    lines = [
        f"status     {descent.status} after {rounded(descent.time)} s at x = {rounded(descent.state.x)} m",
        *lying,
        f"jam        {metrics}, jam index {rounded(float(jam.jam_index))}{passed}",
        "",
        "energy [J]",
        *aligned(ledger, ("<14", ">16"), gap=""),
    ]
    return "\n".join(lines)


def story(descent: Descent) -> str:
    """Return setting, rebounds and outcome of a descent, with blank lines between them."""
    begin = setting(descent.body, descent.law, descent.slope, descent.launch)
    return "\n\n".join([begin, rebound_table(descent), summary(descent)])
