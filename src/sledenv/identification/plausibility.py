"""Tables of rebounds, read and checked: what they must satisfy whatever the law, and what would mend them."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from sledenv.identification.rebounds import AFTER, ARMS, BEFORE, POSE, TOUCHDOWN, Rebounds, arms_of
from sledenv.identification.tables import LARGEST, columns, numbered, place, read_table, recorded_names
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import Rule, checked

FACTOR = 2.0  # by which the moment of the impulses may differ from the change of spin before it is doubted
_SURE = 4.0  # standard errors
_MOST = 0.9  # share of rebounds that must pass a test of each; some may have been measured badly
_FEW = 5  # rebounds, below which neither the work of friction nor a zero of orientations is judged
_UNEXPLAINED = 0.5  # of the squares of changes of spin: what a remedy may leave at most
_BALANCED = 0.01  # of these squares: rolling resistance leaves so much, with the right zero, where spins turn
_ALIKE, _NOTHING = 2.0, 1e-6  # remedies that leave up to so many times the least, or next to nothing, are as good
# How far what is left must fall with another zero of orientations: to half, and in terms of F (Fisher's ratio) of the
# one angle. So high, as rolling that stops within an impact leaves what is no noise.
_HALF, _CLEARLY = 2.0, 90.0
_SAME = 1.1  # times the least that is left: as little, as of a body that looks alike from several sides
_ZEROS = 360  # of orientations that are tried in a turn
_ENOUGH = 500  # rebounds tell a zero of orientations; more take longer
_CENTRED = 1e-6  # of the distance of the contact: an arm a that counts as none
_BACK = 0.05  # of the slip before: what a slip that is reversed is more than
_GRIPPING = 0.5  # of the slip before: a larger slip after counts as one that never ended
_AROUND = np.linspace(-math.pi, math.pi, 33)  # [rad] orientations
_HALF_GRAVITY = 0.5 * 9.81  # [m/s^2] of it the restitution does not depend
_LENGTH: Rule = (lambda v: (v >= 1.0 / LARGEST) & (v <= LARGEST), f"in [{1.0 / LARGEST:g}, {LARGEST:g}] m")

# What holds of each rebound: what is said of those that fail, and which pass.
_OF_EACH: tuple[tuple[str, Callable[[Rebounds], NDArray[np.bool_]]], ...] = (
    ("open before the impact", lambda rebounds: rebounds.approach > 0.0),
    ("still approach afterwards", lambda rebounds: rebounds.opening >= 0.0),
    ("have more energy after than before", lambda rebounds: rebounds.energy_after <= rebounds.speed**2),
)

# What else a table could mean: words, and factors of phi; of a and b; of u, v and omega; of the radius of gyration.
_Remedy = tuple[str, float, tuple[float, float], tuple[float, float, float], float]
_DEGREE, _MM = math.pi / 180.0, 1e-3
_SAME_ARMS, _SAME_VELOCITIES = (1.0, 1.0), (1.0, 1.0, 1.0)
_REMEDIES: tuple[_Remedy, ...] = (
    ("the sign of v were turned", 1, _SAME_ARMS, (1, -1, 1), 1),
    ("the sign of omega were turned", 1, _SAME_ARMS, (1, 1, -1), 1),
    ("omega were in degrees per second", 1, _SAME_ARMS, (1, 1, _DEGREE), 1),
    ("u and v were in mm/s", 1, _SAME_ARMS, (_MM, _MM, 1), 1),
)
_REMEDIES_OF_ARMS: tuple[_Remedy, ...] = (
    ("y pointed away from the surface: turn the signs of v, omega and a", 1, (-1, 1), (1, -1, -1), 1),
    # A mirror takes one of these to another, so that no law tells them apart.
    ("the sign of b, or of u, or those of a and omega, were turned", 1, (1, -1), _SAME_VELOCITIES, 1),
    ("the sign of a were turned", 1, (-1, 1), _SAME_VELOCITIES, 1),
    ("the arms were in mm", 1, (_MM, _MM), _SAME_VELOCITIES, 1),
    ("the arms and the radius of gyration were in mm", 1, (_MM, _MM), _SAME_VELOCITIES, _MM),
    ("the radius of gyration were in mm", 1, _SAME_ARMS, _SAME_VELOCITIES, _MM),
)
_REMEDIES_OF_POSES: tuple[_Remedy, ...] = (
    ("y pointed away from the surface: turn the signs of v, omega and phi_rad", -1, _SAME_ARMS, (1, -1, -1), 1),
    ("all angles counted clockwise: turn the signs of phi_rad and omega", -1, _SAME_ARMS, (1, 1, -1), 1),
    ("phi_rad alone counted clockwise, from y to x: turn its sign", -1, _SAME_ARMS, _SAME_VELOCITIES, 1),
    ("the sign of u were turned", 1, _SAME_ARMS, (-1, 1, 1), 1),
    ("phi_rad were in degrees", _DEGREE, _SAME_ARMS, _SAME_VELOCITIES, 1),
    ("phi_rad were in degrees, and omega in degrees per second", _DEGREE, _SAME_ARMS, (1, 1, _DEGREE), 1),
    ("all lengths of the body were in mm: give them in m", 1, (_MM, _MM), _SAME_VELOCITIES, _MM),
    (
        "the outline of the body were in mm, not its radius of gyration: give it in m",
        1,
        (_MM, _MM),
        _SAME_VELOCITIES,
        1,
    ),
)


def doubts(rebounds: Rebounds) -> Iterator[str]:
    """Yield what is strange about rebounds, whatever the law, a sentence each."""
    found = list(_contradictions(rebounds))
    if found:
        mended = remedy(rebounds)
        yield from (f"{text}{mended}" for text in found)
    elif (angle := other_zero(rebounds)) is not None:
        yield f"the spins would balance far better if {_zero_words(angle)}"
    for words, passes in _OF_EACH:
        failed = np.flatnonzero(~passes(rebounds))
        if len(failed):
            yield f"{len(failed)} rebounds {words}, the first of them in {rebounds.place(failed[0])}"
    if rebounds.normal_alone:
        yield "normal speeds alone tell the restitution, and nothing of friction and rolling arms"


def _contradictions(rebounds: Rebounds) -> Iterator[str]:
    """Yield what no law explains, taken over all rebounds."""
    for name, (share, error) in rebounds.balance().iterrows():
        if (share < 1.0 / FACTOR and share + _SURE * error < 1.0) or (share > FACTOR and share - _SURE * error > 1.0):
            yield (
                f"the spins do not balance: they change by {share:.3g} +- {error:.2g} times the moment of the "
                f"impulse at the arm {name}, not by 1 times; is the sign of an arm, of omega or of u told wrongly, "
                "or a unit?"
            )
    before, after = rebounds.slips
    work = (rebounds.after[:, 0] - rebounds.before[:, 0]) * 0.5 * (before + after)
    if len(work) >= _FEW and float(work.mean()) > _SURE * float(work.std()) / math.sqrt(len(work)):
        yield "friction speeds up the slips of the contact point, u + b omega, where it can only slow them"


def _is_consistent(rebounds: Rebounds) -> bool:
    """Whether some law may have made the rebounds."""
    return all(np.mean(passes(rebounds)) >= _MOST for _, passes in _OF_EACH) and not any(_contradictions(rebounds))


def _unexplained(rebounds: Rebounds) -> float:
    """Share of the squares of the changes of spin that the moments of the impulses leave unexplained.

    A moment against the spin, in proportion to the normal impulse, is explained too: rolling resistance has it. The
    tenth of the rebounds that are explained worst do not count, as some may have been measured badly.
    """
    spins = rebounds.changes_of_spin / rebounds.speed
    left = spins - rebounds.moments.sum(axis=1) / rebounds.speed
    rolling = np.sign(rebounds.before[:, 2]) * (rebounds.after - rebounds.before)[:, 1] / rebounds.speed
    left = left - rolling * (rolling @ left) / max(float(rolling @ rolling), np.finfo(float).tiny)
    kept = math.ceil(_MOST * len(rebounds))
    squares, whole = (float(np.sort(of * of)[:kept].sum()) for of in (left, spins))
    return squares / whole if whole > 0.0 else math.inf


def remedy(rebounds: Rebounds) -> str:
    """Return what would make rebounds consistent, as the end of a sentence; "" if nothing that is known does.

    Of several that do, those are named that explain the spins best: a wrong one may be consistent by chance.
    """
    found = {words: _unexplained(other) for words, other in _read_otherwise(rebounds) if _is_consistent(other)}
    angle = other_zero(rebounds)
    if angle is not None and _is_consistent(turned := rebounds.oriented(rebounds.phi + angle)):
        found[_zero_words(angle)] = _ALIKE * _unexplained(turned)  # a number was fitted to get there
    most = min(_UNEXPLAINED, max(_ALIKE * min(found.values(), default=math.inf), _NOTHING))
    best = [words for words, share in found.items() if share <= most]
    return f"; all would agree if {', or if '.join(best)}" if best else ""


def _read_otherwise(rebounds: Rebounds) -> Iterator[tuple[str, Rebounds]]:
    """Yield each remedy in words, and the rebounds that the table then holds."""
    others = _REMEDIES_OF_ARMS if rebounds.body is None else _REMEDIES_OF_POSES
    for words, phi, arms, velocities, radius in (*_REMEDIES, *others):
        turned = rebounds if phi == 1 else rebounds.oriented(phi * rebounds.phi)
        yield (
            words,
            replace(
                turned,
                gyration_radius=turned.gyration_radius * radius,
                contacts=turned.contacts * np.array([*arms, *velocities]),
                after=turned.after * np.array(velocities),
            ),
        )
    swapped = np.hstack([rebounds.arms, rebounds.after])
    yield "before and after were exchanged", replace(rebounds, contacts=swapped, after=rebounds.before)


def other_zero(rebounds: Rebounds) -> float | None:
    """Return what has to be added to orientations [rad] so that spins balance far better; None if nothing has.

    The least of such angles, as a body may look alike from several sides. Where an arc rolls about its own centre, and
    where rolling resistance does the same to spins, nothing is told.
    """
    if rebounds.body is None or len(rebounds) < _FEW:
        return None
    some = rebounds.rows(np.unique(np.linspace(0, len(rebounds) - 1, min(len(rebounds), _ENOUGH)).astype(int)))

    def left(angle: float) -> float:
        return _unexplained(some.oriented(some.phi + angle))

    if left(0.0) < _BALANCED:
        return None
    step = 2.0 * math.pi / _ZEROS
    angles = step * (np.arange(_ZEROS) - _ZEROS // 2)
    shares = np.array([left(angle) for angle in angles])
    valleys = angles[(shares <= np.roll(shares, 1)) & (shares < np.roll(shares, -1))]
    ends = [minimize_scalar(left, bounds=(angle - step, angle + step)) for angle in valleys]
    least = max(min((float(end.fun) for end in ends), default=math.inf), _NOTHING)
    if least > _UNEXPLAINED or left(0.0) < max(_HALF, 1.0 + _CLEARLY / (len(some) - 2)) * least:
        return None
    return min((float(end.x) for end in ends if end.fun <= _SAME * least), key=abs)


def _zero_words(angle: float) -> str:
    return f"phi_rad, now from another zero, were larger by {angle:.3g} rad ({math.degrees(angle):.3g} degrees)"


def check_slips(rebounds: Rebounds) -> None:
    """Refuse rebounds of a body hit below its mass centre whose slips are reversed.

    Friction ends the slip of such a body at most, as the normal impulse does not turn it. Rolling resistance may go on
    from there: a slip counts as reversed if it is so without what the moment of rolling has added to it, too. Judged
    are all rebounds, and those alone whose slip ends, or nearly.

    Raises
    ------
    ValueError
    """
    a, b = rebounds.arms.T
    slip, after = rebounds.slips
    unrolled = slip + (1.0 + (b / rebounds.gyration_radius) ** 2) * (rebounds.after[:, 0] - rebounds.before[:, 0])
    rows = np.flatnonzero((np.abs(a) <= _CENTRED * np.abs(b)) & (slip != 0.0))
    left = np.clip(np.maximum(after[rows] / slip[rows], unrolled[rows] / slip[rows]), -1.0, 1.0)  # of the slip before
    for some in (np.abs(left) < _GRIPPING, np.abs(left) <= 1.0):
        weights = slip[rows][some] ** 2
        if len(weights) < _FEW:
            continue
        mean = float(np.average(left[some], weights=weights))
        error = float(np.linalg.norm(weights * (left[some] - mean)) / weights.sum())
        if mean < -max(_BACK, _SURE * error):
            back = rows[some & (left < 0.0)]
            raise ValueError(
                f"the table: the slip of the contact point, u + b omega, is reversed in {len(back)} of "
                f"{len(rebounds)} rebounds, the first of them in {rebounds.place(back[0])}, to {mean:.2g} times what "
                "it was, on average. Friction can end the slip of a body that is hit below its mass centre, not "
                "reverse it: no such law explains them"
            )


def read_rebounds(
    table: pd.DataFrame | str | os.PathLike[str],
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
) -> Rebounds:
    """Check a table of rebounds as :func:`sledenv.identify` takes it.

    Raises
    ------
    TypeError, ValueError
        Naming the column, row or argument, its value and what is allowed.
    OSError
        If the file cannot be read.
    """
    if not isinstance(table, pd.DataFrame):
        table = read_table(table)
    if not len(table):
        raise ValueError("the table has no rows")
    table, body = numbered(table), None if body is None else made_body(body)
    speeds = _of_normal_speeds(table)
    if speeds is not None:
        if body is not None and np.abs(arms_of(body, _AROUND)[0][:, 0]).max() > _CENTRED * body.size:
            raise ValueError(f"body = {body!r}: spins must be given, as it is not hit below its mass centre")
        table, body, gyration_radius = speeds, None, 1.0 if gyration_radius is None else gyration_radius
    if (body is None) == (gyration_radius is None):
        raise ValueError("body, gyration_radius: one of them must be given, and one only")
    before, after = columns(table, BEFORE), columns(table, AFTER)
    phi, corner = np.zeros(0), np.zeros(len(table), bool)
    if body is not None:
        k = checked("body", "gyration_radius", math.sqrt(body.inertia / body.mass), _LENGTH)
        phi = columns(table, POSE)[:, 0]
        reach, corner = arms_of(body, phi)
    else:
        k = checked("identify", "gyration_radius", gyration_radius, _LENGTH)
        reach = columns(table, ARMS)
    names = recorded_names(table)
    recordings = np.arange(len(table)) if names is None else pd.factorize(names)[0]
    places = np.array([place(table, row) for row in range(len(table))])
    found = Rebounds(k, np.hstack([reach, before]), after, corner, recordings, places, body, phi)
    leaving = found.approach <= 0.0
    if leaving.any():
        row = int(np.argmax(leaving))
        raise ValueError(
            f"{found.place(row)}: the gap opens at {-found.approach[row]:.4g} m/s before the impact, where it must "
            f"close (v_before - a omega_before < 0); {np.count_nonzero(leaving)} of {len(found)} rows are no rebounds"
            + remedy(found)
        )
    return found


def _of_normal_speeds(table: pd.DataFrame) -> pd.DataFrame | None:
    """Rebounds without spin and slip, of a table that has speeds normal to the slope alone; None if it has more.

    Times of touchdown alone tell them as well.
    """
    if any(str(name).startswith("omega") for name in table.columns):
        return None
    if BEFORE[1] not in table or AFTER[1] not in table:
        if TOUCHDOWN not in table or any(name in table for name in (*BEFORE, *AFTER)):
            return None
        table = _of_touchdowns(table)
    return table.assign(**dict.fromkeys((*ARMS, BEFORE[0], BEFORE[2], AFTER[0], AFTER[2]), 0.0))


def _of_touchdowns(table: pd.DataFrame) -> pd.DataFrame:
    """Rebounds of free bounces: a flight lasts in proportion to the speed that it begins and ends with."""
    names = recorded_names(table)
    times = pd.Series(columns(table, (TOUCHDOWN,))[:, 0], table.index)
    recordings = times.groupby(np.zeros(len(table), int) if names is None else names)
    before, after = recordings.diff(), -recordings.diff(-1)
    if (before <= 0.0).any():
        row = int(np.argmax(before <= 0.0))
        raise ValueError(f"{TOUCHDOWN}, {place(table, row)}: is {times.iloc[row]:g}, must increase within a recording")
    told = before.notna() & after.notna()
    if not told.any():
        raise ValueError(f"{TOUCHDOWN}: must have 3 rows or more of a recording, to tell a rebound")
    return table.assign(**{BEFORE[1]: -_HALF_GRAVITY * before, AFTER[1]: _HALF_GRAVITY * after})[told]
