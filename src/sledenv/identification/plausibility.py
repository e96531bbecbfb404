"""What a recording of rebounds must satisfy whatever the law, and which other sign, unit or zero would mend it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from sledenv.identification.objective import Floats

if TYPE_CHECKING:
    from sledenv.identification.rebounds import Rebounds

FACTOR = 2.0  # by which the moment of the impulses may differ from the change of spin before it is doubted
_SURE = 4.0  # standard errors
_MOST = 0.9  # share of rebounds that must close, open and lose energy; some may have been measured badly
_FEW = 5  # rebounds, below which neither the work of friction nor a zero of orientations is judged
_DEGREE, _MILLI = math.pi / 180.0, 1e-3
_UNEXPLAINED = 0.5  # of the squares of changes of spin: what a remedy may leave at most
_ALIKE, _NOTHING = 2.0, 1e-6  # remedies that leave up to so many times the least, or next to nothing, are as good
# How far what is left must fall with another zero of orientations: to half, and in terms of F (Fisher's ratio) of the
# one angle. So high, as rolling that stops within an impact leaves what is no noise.
_HALF, _CLEARLY = 2.0, 90.0
_SAME = 1.1  # times the least that is left: as little, as of a body that looks alike from several sides
_ZEROS = 360  # of orientations that are tried in a turn
_ENOUGH = 500  # rebounds tell a zero of orientations; more take longer


def off_balance(share: float, error: float) -> bool:
    """Whether a share of :meth:`Rebounds.balance` is so far from 1 that no law makes good for it."""
    small = share < 1.0 / FACTOR and share + _SURE * error < 1.0
    return small or (share > FACTOR and share - _SURE * error > 1.0)


def friction_drives(rebounds: Rebounds) -> bool:
    """Whether friction, taken over all rebounds, speeds slips up: its impulse times the mean of the slips is work."""
    if len(rebounds) < _FEW:
        return False
    slips = [of[:, 0] + rebounds.arms[:, 1] * of[:, 2] for of in (rebounds.before, rebounds.after)]
    work = (rebounds.after[:, 0] - rebounds.before[:, 0]) * 0.5 * (slips[0] + slips[1])
    return float(work.mean()) > _SURE * float(work.std()) / math.sqrt(len(work))


def is_consistent(rebounds: Rebounds) -> bool:
    """Whether rebounds may be those of a body that some law makes: gaps, energy, spins and slips."""
    well = rebounds.approach > 0.0, rebounds.opening >= 0.0, rebounds.energy_after <= rebounds.speed**2
    shares = rebounds.balance().itertuples(index=False)
    return (
        all(np.mean(rows) >= _MOST for rows in well)
        and not any(off_balance(share, error) for share, error in shares)
        and not friction_drives(rebounds)
    )


def unexplained(rebounds: Rebounds) -> float:
    """Return which share of the squares of the changes of spin the moments of the impulses leave unexplained.

    A moment against the spin, in proportion to the normal impulse, is explained too: rolling resistance has it. The
    tenth of the rebounds that are explained worst do not count, as some may have been measured badly.
    """
    change = (rebounds.after - rebounds.before) / rebounds.speed[:, None]
    spins = rebounds.gyration_radius**2 * change[:, 2]
    left = spins + rebounds.arms[:, 0] * change[:, 1] - rebounds.arms[:, 1] * change[:, 0]
    rolling = np.sign(rebounds.before[:, 2]) * change[:, 1]
    left = left - rolling * (rolling @ left) / max(float(rolling @ rolling), np.finfo(float).tiny)
    kept = math.ceil(_MOST * len(rebounds))
    squares, whole = (float(np.sort(of * of)[:kept].sum()) for of in (left, spins))
    return squares / whole if whole > 0.0 else math.inf


def remedy(rebounds: Rebounds) -> str:
    """Return what would make rebounds consistent, as the end of a sentence; "" if nothing that is known does.

    Of several that do, those are named that explain the spins best: a wrong one may be consistent by chance.
    """
    found = {words: unexplained(other) for words, other in _read_otherwise(rebounds) if is_consistent(other)}
    angle = other_zero(rebounds)
    if angle is not None and is_consistent(turned := rebounds.oriented(rebounds.phi + angle)):
        found[zero_words(angle)] = _ALIKE * unexplained(turned)  # a number was fitted to get there
    most = min(_UNEXPLAINED, max(_ALIKE * min(found.values(), default=math.inf), _NOTHING))
    best = [words for words, share in found.items() if share <= most]
    return f"; all would agree if {', or if '.join(best)}" if best else ""


def other_zero(rebounds: Rebounds) -> float | None:
    """Return what has to be added to orientations [rad] so that spins balance far better; None if nothing has.

    The least of such angles, as a body may look alike from several sides. Where an arc rolls about its own centre, and
    where rolling resistance does the same to spins, nothing is told.
    """
    if rebounds.body is None or len(rebounds) < _FEW:
        return None
    some = rebounds.rows(np.unique(np.linspace(0, len(rebounds) - 1, min(len(rebounds), _ENOUGH)).astype(int)))

    def left(angle: float) -> float:
        return unexplained(some.oriented(some.phi + angle))

    step = 2.0 * math.pi / _ZEROS
    angles = step * (np.arange(_ZEROS) - _ZEROS // 2)
    shares = np.array([left(angle) for angle in angles])
    valleys = angles[(shares <= np.roll(shares, 1)) & (shares < np.roll(shares, -1))]
    ends = [
        minimize_scalar(left, (angle - step, angle, angle + step), (angle - step, angle + step), method="bounded")
        for angle in valleys
    ]
    if not ends:
        return None
    least = max(min(float(end.fun) for end in ends), _NOTHING)
    if least > _UNEXPLAINED or left(0.0) < max(_HALF, 1.0 + _CLEARLY / (len(some) - 2)) * least:
        return None
    return min((float(end.x) for end in ends if end.fun <= _SAME * least), key=abs)


def zero_words(angle: float) -> str:
    """Return in words that orientations are to be larger by an angle [rad]."""
    return f"phi_rad, now from another zero, were larger by {angle:.3g} rad ({math.degrees(angle):.3g} degrees)"


def _read_otherwise(rebounds: Rebounds) -> Iterator[tuple[str, Rebounds]]:
    """Yield what else the table could mean, and the rebounds that it then holds."""
    one, two, mirrored = (1.0, 1.0, 1.0), (1.0, 1.0), (1.0, -1.0, -1.0)
    milli = _MILLI, _MILLI
    told: list[tuple[str, Rebounds, tuple[float, ...], tuple[float, ...], float]] = [
        ("the sign of v were turned", rebounds, two, (1.0, -1.0, 1.0), 1.0),
        ("the sign of omega were turned", rebounds, two, (1.0, 1.0, -1.0), 1.0),
        ("omega were in degrees a second", rebounds, two, (1.0, 1.0, _DEGREE), 1.0),
        ("u and v were in mm/s", rebounds, two, (_MILLI, _MILLI, 1.0), 1.0),
    ]
    if rebounds.body is None:
        told += [
            ("y pointed away from the surface: turn the signs of v, omega and a", rebounds, (-1, 1), mirrored, 1),
            # A mirror takes one of these to another, so that no law tells them apart.
            ("the sign of b, or of u, or those of a and omega, were turned", rebounds, (1, -1), one, 1),
            ("the sign of a were turned", rebounds, (-1, 1), one, 1),
            ("the arms were in mm", rebounds, milli, one, 1),
            ("the arms and the radius of gyration were in mm", rebounds, milli, one, _MILLI),
            ("the radius of gyration were in mm", rebounds, two, one, _MILLI),
        ]
    else:
        clockwise, degrees = rebounds.oriented(-rebounds.phi), rebounds.oriented(_DEGREE * rebounds.phi)
        told += [
            ("y pointed away from the surface: turn the signs of v, omega and phi_rad", clockwise, two, mirrored, 1),
            ("all angles counted clockwise: turn the signs of phi_rad and omega", clockwise, two, (1, 1, -1), 1),
            ("phi_rad alone counted clockwise, from y to x: turn its sign", clockwise, two, one, 1),
            ("the sign of u were turned", rebounds, two, (-1, 1, 1), 1),
            ("phi_rad were in degrees", degrees, two, one, 1),
            ("phi_rad were in degrees, and omega in degrees a second", degrees, two, (1, 1, _DEGREE), 1),
            ("all lengths of the body were in mm: give them in m", rebounds, milli, one, _MILLI),
            ("the outline of the body were in mm, not its radius of gyration: give it in m", rebounds, milli, one, 1),
        ]
    for words, other, arms, velocities, radius in told:
        yield words, _scaled(other, arms, velocities, radius)
    swapped = np.hstack([rebounds.arms, rebounds.after])
    yield "before and after were exchanged", replace(rebounds, contacts=swapped, after=rebounds.before)


def _scaled(rebounds: Rebounds, arms: tuple[float, ...], velocities: tuple[float, ...], radius: float) -> Rebounds:
    factors: Floats = np.array([*arms, *velocities])
    return replace(
        rebounds,
        gyration_radius=rebounds.gyration_radius * radius,
        contacts=rebounds.contacts * factors,
        after=rebounds.after * factors[2:],
    )
