"""What a recording of rebounds must satisfy whatever the law, and which change of a sign or a unit would mend it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sledenv.identification.objective import Floats

if TYPE_CHECKING:
    from sledenv.identification.rebounds import Rebounds

FACTOR = 2.0  # by which the moment of the impulses may differ from the change of spin before it is doubted
_SURE = 4.0  # standard errors
_MOST = 0.9  # share of rebounds that must close, open and lose energy; some may have been measured badly
_FEW = 5  # rebounds, below which the work of friction is not judged
_DEGREE, _MILLI = math.pi / 180.0, 1e-3


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


def remedy(rebounds: Rebounds) -> str:
    """Return what would make rebounds consistent, as the end of a sentence; "" if nothing that is known does."""
    found = [words for words, other in _read_otherwise(rebounds) if is_consistent(other)]
    return f"; all would agree if {', or if '.join(found)}" if found else ""


def _read_otherwise(rebounds: Rebounds) -> Iterator[tuple[str, Rebounds]]:
    """Yield what else the table could mean, and the rebounds that it then holds."""
    for words, other in rebounds.other_arms.items():
        yield words, replace(rebounds, contacts=np.hstack([other, rebounds.before]))
    for words, arms, velocities, radius in (
        ("y pointed away from the surface: turn the signs of v, omega and a (of phi)", (-1, 1), (1, -1, -1), 1),
        ("the sign of v were turned", (1, 1), (1, -1, 1), 1),
        ("the sign of omega were turned", (1, 1), (1, 1, -1), 1),
        ("the sign of b, or of u, were turned", (1, -1), (1, 1, 1), 1),
        ("the sign of a were turned", (-1, 1), (1, 1, 1), 1),
        ("omega were in degrees a second", (1, 1), (1, 1, _DEGREE), 1),
        ("the arms were in mm", (_MILLI, _MILLI), (1, 1, 1), 1),
        ("u and v were in mm/s", (1, 1), (_MILLI, _MILLI, 1), 1),
        ("the radius of gyration were in mm", (1, 1), (1, 1, 1), _MILLI),
    ):
        yield words, _scaled(rebounds, arms, velocities, radius)
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
