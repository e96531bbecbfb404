"""All that Python calls from the kernel, as one library of compiled code."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Final

import numpy as np

from sledenv.compiler.entries import Group, Table
from sledenv.compiler.jit import kernel
from sledenv.compiler.library import Library
from sledenv.kernel.arithmetic import sine_cosine, wrap
from sledenv.kernel.batch import descend_lanes, put_at_launch
from sledenv.kernel.books import close_books, trim
from sledenv.kernel.collisions import collide, collide_each
from sledenv.kernel.contacts import IMPACT, SPACE
from sledenv.kernel.geometry import PIECE, build_pieces, height_at
from sledenv.kernel.jam import judge
from sledenv.kernel.outline import BODY, complete, lowest_arms
from sledenv.kernel.outlook import look_out
from sledenv.kernel.params import SCENE, ContactLaw, Limits, Scenes, State, incline_of, launch_of, row_of
from sledenv.kernel.records import OUTCOME, PHASE, REBOUND, TRAJECTORY, Written
from sledenv.kernel.resting import resting_height


def _embark(scenes: Scenes, flights: np.ndarray) -> None:
    """Put descents at their launches, and write their ledgers; all else of their flights is 0."""
    for i in range(flights.shape[0]):
        put_at_launch(scenes.rows[i], flights[i])
        _close(scenes, i, flights[i])


def _trim(scenes: Scenes, spin: float, flights: np.ndarray) -> None:
    """Trim a descent, and write its ledger."""
    scene = scenes.rows[0]
    trim(scenes.bodies[int(scene["body"])], scene["rotor_inertia"], flights[0], spin)
    _close(scenes, 0, flights[0])


@kernel
def _close(scenes: Scenes, lane: int, flight: np.void) -> None:
    """Write the ledger of a descent."""
    scene = scenes.rows[lane]
    pieces, body = scenes.pieces[int(scene["ground"]) : int(scene["ground_end"])], scenes.bodies[int(scene["body"])]
    close_books(body, pieces, incline_of(scene, body), launch_of(scene), flight)


def _complete(bodies: np.ndarray) -> None:
    """Write what follows from the outlines of bodies."""
    for i in range(bodies.shape[0]):
        complete(bodies[i])


def _lowest(bodies: np.ndarray, numbers: np.ndarray, phi: np.ndarray, arcs: np.ndarray, arms: np.ndarray) -> None:
    """Write which arc of each body, by its number, is lowest at each orientation, and its arms."""
    for i in range(phi.shape[0]):
        body = bodies[int(numbers[i])]
        arcs[i], arms[i, 0], arms[i, 1] = lowest_arms(body, wrap(phi[i]))


def _judge_each(flights: np.ndarray, masses: np.ndarray, lengths: np.ndarray, metrics: np.ndarray) -> None:
    """Write the jam metrics of each descent; flights, masses [kg] and lengths [m] are one for each or one for all."""
    for i in range(metrics.shape[0]):
        jam = judge(row_of(flights, i), row_of(masses, i), row_of(lengths, i))
        for k in range(metrics.shape[1]):
            metrics[i, k] = jam[k]


def _build_each(vertices: np.ndarray, tracks: np.ndarray, pieces: np.ndarray) -> None:
    """Write the pieces of many profiles whose vertices lie one behind the other, one vertex fewer than pieces each."""
    for i in range(tracks.shape[0]):
        begin, end = int(tracks[i, 0]), int(tracks[i, 1])
        build_pieces(vertices[begin - i : end - i - 1], pieces[begin:end])


def _heights(pieces: np.ndarray, x: np.ndarray, heights: np.ndarray) -> None:
    """Write the heights of the ground at places."""
    for i in range(x.shape[0]):
        heights[i] = height_at(pieces, x[i])


def _resting(
    bodies: np.ndarray,
    numbers: np.ndarray,
    x: np.ndarray,
    phi: np.ndarray,
    pieces: np.ndarray,
    begins: np.ndarray,
    ends: np.ndarray,
    heights: np.ndarray,
) -> None:
    """Write the heights at which bodies touch the ground from above.

    ``numbers`` tells which body a lane has; its ground is the pieces from ``begins`` to the one before ``ends``.
    """
    for i in range(x.shape[0]):
        body, ground = bodies[int(numbers[i])], pieces[int(begins[i]) : int(ends[i])]
        heights[i] = resting_height(body, ground, x[i], phi[i])


def _directions(phi: np.ndarray, cosine: np.ndarray, sine: np.ndarray) -> None:
    for i in range(phi.shape[0]):
        sine[i], cosine[i] = sine_cosine(wrap(phi[i]))


_DOUBLES, _ROWS, _COUNT = Table(np.dtype(float)), Table(np.dtype(float), 2), Table(np.dtype(np.int64))
_LOGS, _TRAJECTORY, _OUTCOMES = Table(REBOUND, 2), Table(TRAJECTORY), Table(OUTCOME)
_SPACES, _IMPACTS, _PHASES, _BODIES, _PIECES = map(Table, (SPACE, IMPACT, PHASE, BODY, PIECE))

_HOME = Path(__file__).parents[1]
LIBRARY: Final = Library(_HOME / "kernel", _HOME / "kernel", _HOME / "compiler")


_SCENES = Group(Scenes, (Table(SCENE), _BODIES, _PIECES, _ROWS))
_WRITTEN = Group(Written, (_OUTCOMES, _LOGS, _TRAJECTORY))

run_lanes: Final = LIBRARY.entry("descend_lanes", descend_lanes, int, Limits, _SCENES, _ROWS, _WRITTEN, _SPACES, int)
run_build_pieces: Final = LIBRARY.entry("build_pieces", build_pieces, _ROWS, _PIECES)
run_heights: Final = LIBRARY.entry("heights", _heights, _PIECES, _DOUBLES, _DOUBLES)
run_build_each: Final = LIBRARY.entry("build_each", _build_each, _ROWS, _ROWS, _PIECES)
run_outlook: Final = LIBRARY.entry("outlook", look_out, _SCENES, _OUTCOMES, _ROWS, _ROWS)
run_embark: Final = LIBRARY.entry("embark", _embark, _SCENES, _OUTCOMES)
run_trim: Final = LIBRARY.entry("trim", _trim, _SCENES, float, _OUTCOMES)
run_judge: Final = LIBRARY.entry("judge", _judge_each, _OUTCOMES, _DOUBLES, _DOUBLES, _ROWS)
run_collision: Final = LIBRARY.entry(
    "collide", collide, _BODIES, ContactLaw, State, float, int, _IMPACTS, _PHASES, _COUNT
)
run_collisions: Final = LIBRARY.entry("collide_each", collide_each, float, _ROWS, _ROWS, int, _IMPACTS, _ROWS, _COUNT)
run_complete: Final = LIBRARY.entry("complete", _complete, _BODIES)
run_lowest: Final = LIBRARY.entry("lowest", _lowest, _BODIES, _DOUBLES, _DOUBLES, _COUNT, _ROWS)
run_resting: Final = LIBRARY.entry(
    *("resting", _resting, _BODIES, _DOUBLES, _DOUBLES, _DOUBLES, _PIECES, _DOUBLES, _DOUBLES, _DOUBLES)
)
run_directions: Final = LIBRARY.entry("directions", _directions, _DOUBLES, _DOUBLES, _DOUBLES)


def _known() -> str:
    """Digest of some descents: on a plane, on a profile, and of rigid surfaces."""
    body, scene = np.zeros(1, BODY), np.zeros(1, SCENE)
    body["mass"], body["inertia"], body["count"] = 1.0, 7.5e-3, 3.0
    body["begin"][0, :3], body["r"][0, 1], body["part"][0, :3] = (-math.pi, -2.0, 2.0), 0.1, (2.0, 1.0, 3.0)
    body["along"][0, :3], body["across"][0, :3] = (0.09161468365471424, 0.05, 0.09161468365471424), (-0.09, 0.0, 0.09)
    body["side"][0, 2], body["corner"][0, :3] = 4.0, (1.0, 0.0, 1.0)
    run_complete(body)
    for name, value in ContactLaw(1e5, 0.6, 0.1, 1e-3, 1e-3)._asdict().items():
        scene[name] = value
    for name, value in State(0.0, 0.6, 0.7, 0.5, 0.0, 1.0)._asdict().items():
        scene[name] = value
    scene["angle"], scene["length"], scene["gravity"] = math.pi / 18.0, math.inf, 9.81
    scene["settle_speed"], scene["rotor_inertia"], scene["zones_end"] = 1e-3, 1.0, 1.0
    zones = np.array([[0.5, 1.0, 0.3, 2e-3, 1e-3, 0.4, math.nan]])
    limits = Limits(3.0, 1e5, 1e-12, 0.01, 12.0, 0.0, 0.0, 0.0, 1e6, 0.0)
    digest = hashlib.sha256()
    vertices = np.array([[0.6, 0.0, 0.0], [1.2, 0.1, 0.0], [1.4, 0.0, 0.0]])
    plane, bumps = np.zeros(1, PIECE), np.zeros(4, PIECE)
    run_build_pieces(vertices[:0], plane)
    run_build_pieces(vertices, bumps)
    for rigid, pieces in ((0, plane), (0, bumps), (1, plane)):
        log, rows, flights = np.zeros(12, REBOUND), np.zeros(400, TRAJECTORY), np.zeros(1, OUTCOME)
        scene["ground_end"] = float(len(pieces))
        scenes = scene, body, pieces, zones
        run_lanes(rigid, limits, *scenes, np.empty((0, 2)), flights, log[np.newaxis], rows, np.zeros(1, SPACE), 1)
        for table in (log, rows, flights):
            digest.update(table.tobytes())
    return digest.hexdigest()


LIBRARY.known = _known
