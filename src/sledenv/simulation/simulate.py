"""One descent, a batch, a batch in blocks: the Python face of the descent loop."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from typing import TYPE_CHECKING, NamedTuple, NoReturn, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel.params import Limits
from sledenv.kernel.records import OUTCOME, TRAJECTORY
from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import Bodies, Laws, Slopes, checked_descent, checked_scenes, limits_of
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.lanes import NO_LOGS, NO_ROWS, blank, check_room, new_log, new_logs, new_trajectory
from sledenv.simulation.outcomes import RECORDS, Descent, DescentBatch, Record, descent_of
from sledenv.simulation.rules import checked_choice, checked_count, checked_flag
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Fields, Settings, changed
from sledenv.simulation.simulator import WHOLE, Simulator

if TYPE_CHECKING:
    from tqdm import tqdm

FIRST_TRAJECTORY = 4096  # rows, before it is known how many a descent takes
_BLOCK = 8192  # lanes of a batch that are simulated together


def simulate(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    settings: Settings | None = None,
    *,
    record: Record = "rebounds",
    **fields: Unpack[Fields],
) -> Descent:
    """Simulate one descent until it finishes, jams or meets a limit.

    An interrupt (Ctrl-C) takes effect within a fraction of a second, however long the descent is.

    Parameters
    ----------
    body, law, slope
        What descends, how it touches and where.
    launch : State
        Where and how it starts; the body must not lie below the surface. Whole turns are taken off ``phi``, into
        [-pi, pi]: orientations of the result count from there, and are not wrapped.
    settings : Settings, optional
        How it is simulated; the default ones otherwise.
    record : {"rebounds", "trajectory"}
        "trajectory" also records positions, velocities and contact forces.
    **fields
        Fields of :class:`sledenv.Settings`, such as ``solver`` and ``max_rebounds``: given here they stand in place of
        those of ``settings``.

    Returns
    -------
    Descent

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; nothing is simulated then.
    MemoryError
        If ``max_rebounds`` records take more memory than there is, before anything is simulated; or if the rows of the
        trajectory do, once they have been counted and before any is kept.
    """
    settings = changed(settings, **fields)
    checked_choice("record", record, RECORDS)
    given = checked_descent(body, law, slope, launch, settings)
    rebounds, limits = new_log(settings.max_rebounds), limits_of(given.body, settings)
    trajectory = np.zeros(FIRST_TRAJECTORY, TRAJECTORY) if record == "trajectory" else NO_ROWS
    flights = blank(OUTCOME)
    simulator = Simulator(given.scenes, settings.solver == "rigid", limits, rebounds[np.newaxis], flights)
    simulator.run(trajectory)
    if record == "trajectory" and (rows := int(simulator.flights["samples"][0])) > len(trajectory):
        trajectory, simulator.flights = new_trajectory(rows, settings.sample_interval), flights
        simulator.run(trajectory)
    return descent_of(*given[:4], simulator.flights[0], rebounds, trajectory, settings)


class _Batch(NamedTuple):
    """A batch that has been checked."""

    scenes: Scenes
    rigid: bool
    limits: Limits

    @classmethod
    def of(cls, body: Bodies, law: Laws, slope: Slopes, launches: ArrayLike, settings: Settings) -> Self:
        """Check a batch."""
        scenes = checked_scenes(body, law, slope, launches, settings)
        return cls(scenes, settings.solver == "rigid", limits_of(body, settings))

    def parts(self, block: int) -> Iterator[slice]:
        """Split the lanes into blocks."""
        lanes = len(self.scenes.rows)
        return (slice(start, min(start + block, lanes)) for start in range(0, lanes, block))

    def log(self, lanes: int, keep: bool) -> np.ndarray:
        """Return empty rebound logs, of no lane unless they are kept."""
        return new_logs(lanes, int(self.limits.max_rebounds)) if keep else NO_LOGS

    def run(self, part: slice, rebounds: np.ndarray) -> DescentBatch:
        """Simulate a block of lanes; their logs are 0."""
        flights = np.zeros(part.stop - part.start, OUTCOME)
        simulator = Simulator(self.scenes.take(part), self.rigid, self.limits, rebounds, flights)
        simulator.run()
        return DescentBatch(simulator.flights, rebounds, simulator.jam())


def simulate_batch(
    body: Bodies,
    law: Laws,
    slope: Slopes,
    launches: ArrayLike,
    settings: Settings | None = None,
    *,
    keep_rebounds: bool = False,
    progress: bool = False,
    **fields: Unpack[Fields],
) -> DescentBatch:
    """Simulate many descents on all cores; lane i equals ``simulate`` of launch i bit for bit.

    An interrupt (Ctrl-C) takes effect once each thread has ended the block of lanes that it is at.

    Parameters
    ----------
    body, law, slope : Body, ContactLaw, Slope, or sequences or arrays of N of them
        One for all lanes or one for each. An array has the fields of a segment, of a law or of a slope in its columns:
        shapes (N, 5), (N, 5) and (N, 3), or (N, 3 + 7 K) with the fields of K zones, NaN where a slope has fewer and
        where a zone has no restitution or stiffness of its own. An array has no profiles.
    launches : array_like, shape (N, 6)
        Columns as in :class:`State`.
    settings : Settings, optional
        How all of them are simulated; the default ones otherwise.
    keep_rebounds : bool
        Return the logs too, N * max_rebounds records of 184 bytes; :func:`simulate_blocks` gives them piece by piece.
    progress : bool
        Show a bar on standard error; needs tqdm.
    **fields
        As for :func:`simulate`.

    Returns
    -------
    DescentBatch
        About 200 bytes a lane, without logs; while it is simulated as much again.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range; nothing is simulated then.
    MemoryError
        If there is no room for the launches, the outcomes or the logs; nothing is simulated then.
    ImportError
        If tqdm is missing and ``progress`` is asked for.
    """
    batch = _Batch.of(body, law, slope, launches, changed(settings, **fields))
    count = len(batch.scenes.rows)
    rebounds = batch.log(count, checked_flag("keep_rebounds", keep_rebounds))
    size = OUTCOME.itemsize + 8 * len(DescentJam._fields)
    check_room(count * size, f"launches: the outcomes of {count}", "take them block by block, see simulate_blocks")
    outcomes = np.zeros(count, OUTCOME)
    jam = np.empty((len(DescentJam._fields), count))
    with _bar(count) if checked_flag("progress", progress) else nullcontext() as bar:
        for part in batch.parts(_BLOCK):
            found = batch.run(part, rebounds[part])
            outcomes.view(WHOLE)[part], jam[:, part] = found.outcomes.view(WHOLE), found.jam
            if bar is not None:
                bar.update(part.stop - part.start)
    return DescentBatch(outcomes, rebounds, DescentJam(*jam))


def simulate_blocks(
    body: Bodies,
    law: Laws,
    slope: Slopes,
    launches: ArrayLike,
    settings: Settings | None = None,
    *,
    block: int = 1024,
    keep_rebounds: bool = True,
    **fields: Unpack[Fields],
) -> Iterator[DescentBatch]:
    """Simulate many descents block by block, for logs that memory cannot hold all at once.

    Parameters
    ----------
    body, law, slope, launches, settings
        As for :func:`simulate_batch`.
    block : int
        Launches simulated at a time, >= 1.
    keep_rebounds : bool
        Give the logs too, block * max_rebounds records of 184 bytes at a time: 188 MB by default, and as much again
        while the caller still holds the block before.
    **fields
        As for :func:`simulate`.

    Yields
    ------
    DescentBatch
        Of the next ``block`` launches, or of those that are left. They share no memory; put together they are the
        result of :func:`simulate_batch`, bit for bit.

    Raises
    ------
    TypeError, ValueError, MemoryError
        As :func:`simulate_batch`, when it is called.
    """
    batch = _Batch.of(body, law, slope, launches, changed(settings, **fields))
    block = checked_count("block", block)
    keep_rebounds = checked_flag("keep_rebounds", keep_rebounds)
    # Refuses what will not fit before anything is simulated.
    batch.log(min(block, len(batch.scenes.rows)), keep_rebounds)

    def blocks() -> Iterator[DescentBatch]:
        for part in batch.parts(block):
            yield batch.run(part, batch.log(part.stop - part.start, keep_rebounds))

    return blocks()


def _bar(count: int) -> tqdm[NoReturn]:
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise ImportError("progress = True: the bar needs tqdm: pip install tqdm") from error
    return tqdm(total=count, unit=" launches", unit_scale=True)
