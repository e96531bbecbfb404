"""An audit of descents: from the body, the ground and the recorded trajectory alone, without the kernel.

Points that touch lie on the ground and on the body; no point of the body is deeper in the ground than springs are
pressed, and none is in flight; loads push, friction and rolling resistance keep their bounds and oppose the motion; the
body moves by the forces that are recorded, and never jumps; energy is never won.

Where contacts come and go, springs may differ from the geometry by an offset: a crest that has entered the body beside
a pressed arc comes under a side with a depth, at which its spring is relaxed; two contacts that become one are pressed
so deep that they store what both did; a crest that is deeper in the body than an arc is round goes on to the side
behind it, whose normal is another one, with the energy it had. What is deeper than springs are pressed by no more than
they have been pressed, since there was certainly no offset, is counted; what is deeper still is a fault. Where a
contact has been alone since then, its load must be that of its depth.

    python -m tests.audit --seed 1 --count 3000 --ground hills --body sled
    python -m tests.audit --seed 1 --case 17
"""

from __future__ import annotations

import argparse
import math
import signal
import time
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

import numpy as np

import sledenv
from tests import audit_rows as rows
from tests.audit_geometry import CENTRE, CREST, OUTLINE, Ground, Outline, ground_of, outline_of
from tests.profiles import Case, gravity_of
from tests.rough_grounds import BODIES, GROUNDS, code_of, rough_case

TIME, REBOUNDS = 6.0, 400  # [s] and rebounds after which a descent ends
MOST_STEPS = 800  # in contact: of a descent that takes more, a first part of about so many is recorded
SLOW = 2.0  # [s] of processor time
BURIED = 0.25  # of the size: a body that is deeper in the ground is buried, and one whose mass centre is in it
ENDS: Final = ("finish", "jammed", "timeout", "log_full", "buried")
THIN = 0.05  # of the size: the mass centre of a body whose lowest position is below this may come under the ground
LOSSES: Final = ("hysteresis", "sliding", "rolling", "stored")

# Tolerances: far above rounding, far below what anyone would see.
NEAR: Final = 1e-9  # of the size
RATE: Final = 1e-9  # of the largest speed: a gap rate that is larger tells whether the spring closes or opens
AIR: Final = 1e-3  # of the size: who is further from the ground than this rides through the air
SPEED: Final = 1e-8  # of the largest speed
PULL: Final = 1e-9  # of weight and loads
FORCE: Final = 1e-7  # of weight and loads: bounds of friction and rolling resistance
ENERGY: Final = 1e-9  # of the turnover
LEDGER: Final = 1e-8  # of the turnover


class Fault(NamedTuple):
    """A kind of fault, the first row that has it and how much it is at most."""

    kind: str
    amount: float  # the largest
    unit: str
    rows: int = 0  # how many rows show it; none where it is the descent as a whole
    row: int = -1  # the first one
    time: float = math.nan  # [s] of that

    def __str__(self) -> str:
        where = f" in {self.rows} rows from row {self.row} at {self.time:.6g} s" if self.rows else ""
        return f"{self.kind}: {self.amount:.3g} {self.unit}{where}"


class Audit(NamedTuple):
    """The faults of a descent, and counts."""

    faults: list[Fault]
    counts: Counter[str]


class Found(NamedTuple):
    """Findings in the rows of a trajectory: see tests/audit_rows.py."""

    times: np.ndarray
    motions: np.ndarray  # (n, 6)
    touching: np.ndarray
    contacts: np.ndarray  # (n, 8, 6)
    outline: Outline
    ground: Ground
    law: np.ndarray
    speed: float  # [m/s] the largest
    geometry: np.ndarray
    offsets: np.ndarray  # [m] of springs from the geometry
    beyond: np.ndarray
    moved: np.ndarray


def audit(descent: sledenv.simulation.Descent) -> Audit:
    """Audit a descent without zones."""
    if descent.slope.zones:
        raise ValueError("slopes with zones are not audited")
    faults, counts = ends(descent), Counter({f"ended as {descent.status}": 1})
    if len(descent.trajectory):
        if not is_finite(descent.trajectory):
            return Audit([*faults, Fault("not finite", math.nan, "")], counts)
        found = look(descent)
        faults += of_rows(descent, found)
        beyond = found.beyond
        counts["rows"] += len(found.times)
        counts["rows with an offset"] += int(beyond[:, rows.EXPLAINED].sum())
        counts["rows of flight within the ground"] += int(beyond[:, rows.INSIDE].sum())
        counts["births at a depth"] += int(beyond[:, rows.BORN].sum())
        counts["merged contacts"] += int(beyond[:, rows.MERGED].sum())
        counts["crests that passed the centre of an arc"] += int(beyond[:, rows.PASSED].sum())
    return Audit(faults, counts)


def ends(descent: sledenv.simulation.Descent) -> list[Fault]:
    """Return the faults of a descent as a whole."""
    faults, energy = [], descent.energy
    if descent.status not in ENDS:
        faults.append(Fault(str(descent.status), descent.time, "s"))
    if not np.isfinite([*descent.state, *energy]).all():
        return [*faults, Fault("not finite", math.nan, "")]
    scale = turnover(descent)
    if not abs(energy.residual) <= LEDGER * scale:
        faults.append(Fault("ledger", energy.residual / scale, "of turnover"))
    least = min(getattr(energy, name) for name in LOSSES)
    if least < -1e-12 * scale:
        faults.append(Fault("loss below zero", least / scale, "of turnover"))
    wrong = float(mechanical(descent, np.array([descent.state]))[0]) - energy.kinetic - energy.potential
    if not abs(wrong) <= ENERGY * scale:
        faults.append(Fault("energy of the state", wrong / scale, "of turnover"))
    return faults


def turnover(descent: sledenv.simulation.Descent) -> float:
    """Energy [J] on which errors are to be seen."""
    return max(descent.energy.turnover, descent.body.mass * descent.slope.gravity * descent.body.size, 1e-300)


def lowest(body: sledenv.Body) -> float:
    """Lowest height [m] of the mass centre over a plane that the body touches: its hull is that of its circles."""
    angles = np.linspace(-math.pi, math.pi, 3601)
    down = [arc.radius - arc.x * np.sin(angles) - arc.y * np.cos(angles) for arc in body.arcs]
    return float(np.max(down, axis=0).min())


def mechanical(descent: sledenv.simulation.Descent, motions: np.ndarray) -> np.ndarray:
    """Kinetic and potential energy [J] of motions (n, 6)."""
    x, y, _, u, v, omega = motions.T
    along, down = gravity_of(descent.slope)
    body = descent.body
    found = body.mass * (0.5 * (u * u + v * v) - along * x - down * y) + 0.5 * body.inertia * omega * omega
    return np.asarray(found)


MOTION: Final = ("x", "y", "phi", "u", "v", "omega")
CONTACT: Final = ("x", "y", "normal_x", "normal_y", "normal", "tangential")


def is_finite(trajectory: np.ndarray) -> bool:
    """Whether all numbers of a trajectory are."""
    numbers = [trajectory[name] for name in ("t", *MOTION, "rolling", "normal", "tangential")]
    return all(np.isfinite(one).all() for one in [*numbers, *(trajectory["contacts"][name] for name in CONTACT)])


def look(descent: sledenv.simulation.Descent) -> Found:
    """Look at all rows of a trajectory."""
    body, law, slope, trajectory = descent.body, descent.law, descent.slope, descent.trajectory
    times, rolling = np.ascontiguousarray(trajectory["t"]), np.ascontiguousarray(trajectory["rolling"])
    motions = np.column_stack([trajectory[name] for name in MOTION])
    contacts = np.stack([trajectory["contacts"][name] for name in CONTACT], axis=-1)
    touching = trajectory["touching"].astype(np.int64)
    speeds = np.hypot(motions[:, 3], motions[:, 4]) + body.size * np.abs(motions[:, 5])
    speed = max(float(speeds.max()), math.sqrt(slope.gravity * body.size), 1e-300)
    springs = law.stiffness * (1.0 + law.asymmetry), law.stiffness * (1.0 - law.asymmetry)
    arm, weight = max(law.rolling_arm, law.corner_rolling_arm), body.mass * slope.gravity
    given = law.friction, arm, body.mass, body.inertia, body.size, *gravity_of(slope)
    constants = np.array([*springs, *given, NEAR * body.size, RATE * speed, weight])
    outline, ground = outline_of(body), ground_of(slope.profile, slope.rounding or None)
    geometry = np.zeros((len(times), rows.COLUMNS))
    offsets = np.full((len(times), rows.MOST), math.nan)
    steps = np.zeros(len(times), np.int64)
    beyond, moved = np.zeros((len(times), rows.ALLOWED)), np.zeros((len(times), 4))
    rows.look_at_rows(*outline, *ground, constants, motions, rolling, contacts, touching, geometry, offsets)
    rows.number_steps(times, touching, steps)
    rows.explain(times, touching, contacts, geometry, offsets, NEAR * body.size, steps, beyond)
    rows.follow_forces(constants, times, touching, motions, steps, geometry, moved)
    return Found(
        times, motions, touching, contacts, outline, ground, constants, speed, geometry, offsets, beyond, moved
    )


def of_rows(descent: sledenv.simulation.Descent, found: Found) -> list[Fault]:
    """Return the faults that rows of a trajectory show.

    The last row of a body that is buried may hold a contact that could not go on: only its depth counts.
    """
    geometry, beyond, moved, size = found.geometry, found.beyond, found.moved, descent.body.size
    faults: list[Fault] = []
    buried = descent.status == "buried"
    count = len(found.times) - (1 if buried else 0)

    def check(kind: str, amounts: np.ndarray, limit: float | np.ndarray, unit: str) -> None:
        wrong = np.flatnonzero(~(amounts <= limit)[:count])
        if len(wrong):
            first = int(wrong[0])
            time_of = float(found.times[first])
            faults.append(Fault(kind, float(amounts[wrong].max()), unit, len(wrong), first, time_of))

    near, energy = NEAR * size, turnover(descent)
    check("time", -np.diff(found.times, prepend=found.times[0]), 0.0, "s")
    check("air", geometry[:, rows.AIR], AIR * size, "m")
    check("beside the ground", np.where(geometry[:, rows.AIR] > AIR * size, 0.0, geometry[:, rows.AIR]), near, "m")
    check("under the ground", beyond[:, rows.TOO_LOW], near, "m")
    check("outline", beyond[:, rows.TOO_FAR_IN], near, "m")
    check("normal", geometry[:, rows.ODD], 0.0, "")
    check("spring", beyond[:, rows.SPRING], near, "m")
    check("spring in a step", beyond[:, rows.DRIFT], near, "m")
    check("springs at once", beyond[:, rows.CHANGED] / energy, ENERGY, "of turnover")
    check("depth", beyond[:, rows.TOO_DEEP], near, "m")
    check("depth in flight", beyond[:, rows.IN_FLIGHT], near, "m")
    check("pull", -geometry[:, rows.LEAST], PULL, "of loads")
    check("friction", geometry[:, rows.GRIP], FORCE, "of loads")
    check("rolling", geometry[:, rows.ROLL], FORCE, "of loads")
    check("driving friction", geometry[:, rows.DRIVE] / found.speed, FORCE, "of loads and speed")
    check("forces", moved[:, 0] / found.speed, SPEED, "of speed")
    check("velocities", moved[:, 1], near, "m")
    check("jump of velocity", moved[:, 2] / found.speed, SPEED, "of speed")
    check("jump of place", moved[:, 3], near, "m")
    sums = descent.trajectory["normal"], descent.trajectory["tangential"]
    wrong = [np.abs(found.contacts[:, :, rows.LOAD + k].sum(axis=1) - each) for k, each in enumerate(sums)]
    check("sums", np.maximum(*wrong) / (found.law[rows.WEIGHT] + np.abs(sums[0])), FORCE, "of loads")
    check("energy", _won(descent, found) / energy, ENERGY, "of turnover")

    outline, centre = geometry[:, OUTLINE], geometry[:, CENTRE]
    deepest, end = max(outline[-1], geometry[-1, CREST]), float(found.times[-1])
    last = 1, len(found.times) - 1, end
    if not buried:
        under = max(THIN * size - lowest(descent.body), 0.0)
        deep = np.where((outline > BURIED * size) | (centre > under), np.maximum(outline, centre), 0.0)
        check("not buried", deep / size, 0.0, "of size")
    elif not (deepest > BURIED * size * (1.0 - 1e-3) or centre[-1] > -1e-3 * size):
        faults.append(Fault("buried too early", float(deepest) / size, "of size", *last))
    if descent.status == "finish" and max(beyond[-1, rows.TOO_DEEP], beyond[-1, rows.IN_FLIGHT]) > near:
        faults.append(Fault("finish under the ground", float(deepest), "m", *last))
    return faults


def _won(descent: sledenv.simulation.Descent, found: Found) -> np.ndarray:
    """Energy [J] that each row has more than the least before, 0 where that of springs is not known."""
    energy = mechanical(descent, found.motions) + found.geometry[:, rows.STORED]
    known = ~np.isnan(energy)
    before = np.minimum.accumulate(np.r_[descent.energy.initial, np.where(known, energy, math.inf)])[:-1]
    return np.where(known, energy - before, 0.0)


# Random descents.


class OutOfPatience(Exception):
    """A descent takes too much processor time."""


@contextmanager
def patience(seconds: float | None) -> Iterator[None]:
    """Interrupt what takes more processor time [s] than this, where the platform can."""
    if seconds is None or not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: object) -> None:
        raise OutOfPatience

    before = signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def recorded(case: Case, whole: sledenv.simulation.Descent, most_steps: int = MOST_STEPS) -> sledenv.simulation.Descent:
    """Return the descent of a case with its trajectory, or a first part of one that takes too many steps."""
    steps = int(whole.outcome["steps"])
    end = TIME if steps <= most_steps else max(whole.time * most_steps / steps, 1e-6)
    return sledenv.simulate(*case[1:], max_time=end, max_rebounds=REBOUNDS, record="trajectory")


def audited(case: Case, *, most_steps: int = MOST_STEPS, seconds: float | None = None) -> Audit:
    """Simulate a case and audit it: the end of all of it, and the rows of what is recorded.

    Where ``seconds`` of processor time are given, one that takes more is a fault.
    """
    try:
        with patience(seconds):
            whole = sledenv.simulate(*case[1:], max_time=TIME, max_rebounds=REBOUNDS)
    except OutOfPatience:
        return Audit([Fault("slow", math.inf if seconds is None else seconds, "s")], Counter({"ended as slow": 1}))
    found = audit(recorded(case, whole, most_steps))
    if whole.outcome["steps"] > most_steps:
        counts = found.counts - Counter({name: 1 for name in found.counts if name.startswith("ended")})
        counts["recorded in part"] += 1
        ended = Counter({f"ended as {whole.status}": 1})
        return Audit([*ends(whole), *(fault for fault in found.faults if fault.rows)], counts + ended)
    return found


# The script.


def table_of(faults: dict[str, list[tuple[int, Fault]]]) -> list[str]:
    """Return a table of the kinds of faults, the commonest first."""
    lines = [f"{'fault':<24} {'descents':>8}  {'worst':>9} {'unit':<18} {'in case':>8}  first cases"]
    for kind, found in sorted(faults.items(), key=lambda item: -len(item[1])):
        worst, fault = max(found, key=lambda one: abs(one[1].amount) if math.isfinite(one[1].amount) else math.inf)
        first = " ".join(str(number) for number, _ in found[:8])
        lines.append(f"{kind:<24} {len(found):>8}  {fault.amount:>9.2g} {fault.unit:<18} {worst:>8}  {first}")
    return lines


def survey(numbers: range, seed: int, given: dict[str, Any], most_steps: int) -> None:
    """Audit random descents and print what is found."""
    faults: dict[str, list[tuple[int, Fault]]] = defaultdict(list)
    counts, times, wrong = Counter[str](), [], 0
    for number in numbers:
        case = rough_case(seed, number, **given)
        begin = time.process_time()
        found = audited(case, most_steps=most_steps, seconds=SLOW)
        times.append((time.process_time() - begin, number))
        counts += found.counts
        wrong += bool(found.faults)
        for fault in found.faults:
            faults[fault.kind].append((number, fault))
    print(f"{wrong} of {len(numbers)} descents have faults; seed {seed}", *(f"{a} {b}" for a, b in given.items() if b))
    print(*table_of(faults), "", sep="\n")
    print(*(f"{count:>10,} {name}" for name, count in sorted(counts.items())), "", sep="\n")
    total = sum(seconds for seconds, _ in times)
    slowest = ", ".join(f"{seconds:.2f} s in {number}" for seconds, number in sorted(times, reverse=True)[:5])
    print(f"{total:.1f} s of processor time without the draws; the slowest: {slowest}")


def retell(case: Case, most_steps: int, around: int | None) -> None:
    """Print a case as code, its faults, and rows of its trajectory around one of them."""
    print(code_of(case))
    found = audited(case, most_steps=most_steps, seconds=SLOW)
    print(f"simulate = dict(max_time={TIME}, max_rebounds={REBOUNDS})", "", sep="\n")
    print("\n".join(map(str, found.faults)) or "no fault")
    if any(fault.kind == "slow" for fault in found.faults):
        return
    descent = recorded(case, sledenv.simulate(*case[1:], max_time=TIME, max_rebounds=REBOUNDS), most_steps)
    if around is None:
        around = min((fault.row for fault in found.faults if fault.row >= 0), default=0)
    which = range(max(around - 2, 0), min(around + 3, len(descent.trajectory)))
    print("", descent, *told_rows(descent, which), sep="\n")


def told_rows(descent: sledenv.simulation.Descent, which: range) -> Iterator[str]:
    """Yield rows of a trajectory in words."""
    found, law = look(descent), descent.law
    springs = law.stiffness * (1.0 + law.asymmetry), law.stiffness * (1.0 - law.asymmetry)
    for i in which:
        x, y, phi, u, v, omega = found.motions[i]
        outline, crest, centre = found.geometry[i, :3]
        yield (
            f"row {i}  t {found.times[i]:.9g}  x {x:.9g}  y {y:.9g}  phi {phi:.9g}  u {u:.6g}  v {v:.6g}  "
            f"omega {omega:.6g}\n    outline {outline:.3g} m under the ground, crests {crest:.3g} m in the body, "
            f"mass centre {centre:.3g} m; springs {found.geometry[i, rows.SPRINGS]:.3g} m"
        )
        for k in range(found.touching[i]):
            place_x, place_y, nx, ny, normal, tangential = found.contacts[i, k]
            at = descent.trajectory["contacts"][i, k]
            yield (
                f"    {descent.body.parts[at['part'] - 1]} on ground {at['ground']} at ({place_x:.6g}, {place_y:.6g}), "
                f"normal ({nx:.5f}, {ny:.5f}): N {normal:.6g}, F {tangential:.6g} N; spring {normal / springs[0]:.4g} "
                f"to {normal / springs[1]:.4g} m, offset {found.offsets[i, k]:.3g} m"
            )


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="Audit random descents.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--ground", choices=list(GROUNDS))
    parser.add_argument("--body", choices=list(BODIES))
    parser.add_argument("--steps", type=int, default=MOST_STEPS, help="in contact, of which rows are recorded")
    parser.add_argument("--case", type=int, help="tell all about one case")
    parser.add_argument("--row", type=int, help="of its trajectory, around which rows are told")
    given = parser.parse_args()
    kinds = {"ground": given.ground, "body": given.body}
    if given.case is not None:
        retell(rough_case(given.seed, given.case, **kinds), given.steps, given.row)
    else:
        survey(range(given.first, given.first + given.count), given.seed, kinds, given.steps)


if __name__ == "__main__":
    warnings.filterwarnings("ignore", ".*too finely")  # random dips are cut as finely as they come
    main()
