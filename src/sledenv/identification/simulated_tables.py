"""Tables of what was simulated, as :func:`sledenv.identify` reads them, of many descents at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sledenv.identification.recorded_tables import RECORDING
from sledenv.pages.columns import rebound_columns, rebound_rows, trajectory_columns
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.scene import State


def recorded_rebounds(
    found: Descent | Sequence[Descent] | DescentBatch, body: Body | None = None, launches: ArrayLike | None = None
) -> pd.DataFrame:
    """Return the table of the rebounds of what was simulated, which :func:`sledenv.identify` reads.

    It has the columns of ``sledenv simulate --rebounds-csv``, and ``recording``, the number of the descent. Contacts
    that last are in it, ``duration_s`` [s], and one in which a descent ended: leave these out of a fit of impacts.

    Parameters
    ----------
    found : Descent, sequence of Descent, or DescentBatch
        A batch must have been simulated with ``keep_rebounds=True``.
    body, launches : Body, array_like of shape (N, 6)
        What a batch was simulated with; a descent knows its own.

    Returns
    -------
    DataFrame
        One row a contact; ``to_csv(file, index=False)`` writes it.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and what is allowed.
    """
    if isinstance(found, DescentBatch):
        return _joined(_of_batch(found, body, launches))
    if body is not None or launches is not None:
        name, value = ("body", body) if body is not None else ("launches", launches)
        raise ValueError(f"{name} = {value!r}: must be given with a batch only; a Descent knows its own")
    return _joined([rebound_columns(one) for one in _descents(found)])


def recorded_poses(found: Descent | Sequence[Descent]) -> pd.DataFrame:
    """Return the table of poses over time of what was simulated, which :func:`sledenv.identify` reads.

    It has the columns of ``sledenv simulate --csv``, and ``recording``, the number of the descent.

    Parameters
    ----------
    found : Descent or sequence of Descent
        Simulated with ``record="trajectory"``.

    Returns
    -------
    DataFrame
        One row a sample; ``to_csv(file, index=False)`` writes it.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and what is allowed.
    """
    descents = _descents(found)
    for number, one in enumerate(descents):
        if not len(one.trajectory):
            raise ValueError(f'found, descent {number}: has no trajectory: simulate it with record="trajectory"')
    return _joined([trajectory_columns(one) for one in descents])


def _descents(found: Descent | Sequence[Descent]) -> Sequence[Descent]:
    several = [found] if isinstance(found, Descent) else found
    if not isinstance(several, Sequence) or not all(isinstance(one, Descent) for one in several):
        raise TypeError(f"found is of the type {type(found).__name__}: must be a Descent or a sequence of them")
    if not several:
        raise ValueError(f"found = {found!r}: must hold at least one Descent")
    return several


def _of_batch(batch: DescentBatch, body: Body | None, launches: ArrayLike | None) -> list[dict[str, list[Any]]]:
    if body is None or launches is None:
        raise ValueError(
            f"{'body' if body is None else 'launches'}: must be given with a batch, which does not keep it"
        )
    body = made_body(body)
    lanes, given = len(batch.outcomes), np.asarray(launches, float)
    if given.shape != (lanes, len(State._fields)):
        raise ValueError(
            f"launches: is of shape {given.shape}, must be that of the batch, {(lanes, len(State._fields))}"
        )
    if batch.rebounds.shape[0] != lanes:
        raise ValueError("found: has no rebounds: simulate the batch with keep_rebounds=True")
    counts, phi = batch.outcomes["rebounds"], given[:, State._fields.index("phi")]
    return [rebound_rows(batch.rebounds[k, : counts[k]], body, float(phi[k])) for k in range(lanes)]


def _joined(parts: list[dict[str, list[Any]]]) -> pd.DataFrame:
    """One table of all, with the numbers of the recordings; a column that only some have is empty in the others."""
    lengths = [len(next(iter(part.values()))) for part in parts]
    names = max(parts, key=len)
    whole = {
        name: [cell for part, length in zip(parts, lengths, strict=True) for cell in part.get(name, [None] * length)]
        for name in names
    }
    return pd.DataFrame({RECORDING: np.repeat(np.arange(len(parts)), lengths), **whole})
