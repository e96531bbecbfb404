"""All that Python calls from the kernel, as one library of compiled code."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from sledenv.compiler.entries import Entry, Table
from sledenv.compiler.library import Library
from sledenv.kernel import geometry
from sledenv.kernel.batch import descend_lanes
from sledenv.kernel.collisions import collide, collide_each
from sledenv.kernel.descend import SPACE, begin, close_books, trim
from sledenv.kernel.euler import descend_euler
from sledenv.kernel.laws import Law
from sledenv.kernel.params import Body, ContactLaw, Limits, RigidLaw, Slope, State, body_of
from sledenv.kernel.records import OUTCOME, PHASE, REBOUND, TRAJECTORY
from sledenv.kernel.state import CONTACT, HOP, new


def _embark(body: Body, slope: Slope, launch: State, flights: np.ndarray) -> None:
    """Put a descent at its launch, and write its ledger."""
    begin(launch, flights[0])
    close_books(body, geometry.incline_of(slope), launch, flights[0])


def _trim(body: Body, slope: Slope, launch: State, rotor_inertia: float, spin: float, flights: np.ndarray) -> None:
    """Trim a descent, and write its ledger."""
    trim(body, rotor_inertia, flights[0], spin)
    close_books(body, geometry.incline_of(slope), launch, flights[0])


def _arms(body: Body, feature: int, phi: float, found: np.ndarray) -> None:
    found[0], found[1] = geometry.arms(body, feature, phi)


def _feature_geometry(body: Body, feature: int, found: np.ndarray) -> None:
    found[0], found[1], found[2] = geometry.feature_geometry(body, feature)


def _lowest_support(body: Body, found: np.ndarray) -> None:
    found[0] = geometry.lowest_support(body)


def _support_heights(bodies: np.ndarray, phi: np.ndarray, heights: np.ndarray) -> None:
    for i in range(phi.shape[0]):
        heights[i] = geometry.support_height(body_of(bodies, i), phi[i])


def _directions(phi: np.ndarray, cosine: np.ndarray, sine: np.ndarray) -> None:
    for i in range(phi.shape[0]):
        sine[i], cosine[i] = geometry.sine_and_cosine(phi[i])


_DOUBLES, _ROWS, _COUNT = Table(np.dtype(float)), Table(np.dtype(float), 2), Table(np.dtype(np.int64))
_LOG, _LOGS, _TRAJECTORY, _OUTCOMES = Table(REBOUND), Table(REBOUND, 2), Table(TRAJECTORY), Table(OUTCOME)
_SPACES, _CONTACTS, _HOPS, _PHASES = Table(SPACE), Table(CONTACT), Table(HOP), Table(PHASE)

_HOME = Path(__file__).parents[1]
LIBRARY: Final = Library(_HOME / "kernel", _HOME / "kernel", _HOME / "compiler")


def _by_law(name: str, function: Any, *kinds: Any) -> Callable[[Law], Entry]:
    """Return a function that chooses the entry for a law; None stands for the law among the kinds of arguments."""
    compliant, rigid = (
        LIBRARY.entry(f"{name}_{kind}", function, *(law if given is None else given for given in kinds))
        for kind, law in (("compliant", ContactLaw), ("rigid", RigidLaw))
    )
    return lambda law: rigid if isinstance(law, RigidLaw) else compliant


_TABLES = (_ROWS, _ROWS, _ROWS, _ROWS, _ROWS, _OUTCOMES, _LOGS, _TRAJECTORY)

run_lanes: Final = _by_law("descend_lanes", descend_lanes, None, Limits, *_TABLES, _SPACES, int)
run_euler: Final = LIBRARY.entry(
    "descend_euler", descend_euler, Body, ContactLaw, Slope, State, Limits, _LOG, _CONTACTS, _TRAJECTORY, _OUTCOMES
)
run_embark: Final = LIBRARY.entry("embark", _embark, Body, Slope, State, _OUTCOMES)
run_trim: Final = LIBRARY.entry("trim", _trim, Body, Slope, State, float, float, _OUTCOMES)
run_collision: Final = LIBRARY.entry("collide", collide, Body, ContactLaw, State, float, int, _HOPS, _PHASES, _COUNT)
run_collisions: Final = LIBRARY.entry("collide_each", collide_each, float, _ROWS, _ROWS, int, _HOPS, _ROWS, _COUNT)
run_arms: Final = LIBRARY.entry("arms", _arms, Body, int, float, _DOUBLES)
run_feature_geometry: Final = LIBRARY.entry("feature_geometry", _feature_geometry, Body, int, _DOUBLES)
run_lowest_support: Final = LIBRARY.entry("lowest_support", _lowest_support, Body, _DOUBLES)
run_support_heights: Final = LIBRARY.entry("support_heights", _support_heights, _ROWS, _DOUBLES, _DOUBLES)
run_directions: Final = LIBRARY.entry("directions", _directions, _DOUBLES, _DOUBLES, _DOUBLES)


def _known() -> str:
    """Digest of one descent of each law, and of one by Euler's method."""
    body, slope = Body(1.0, 0.1, 0.05, 7.5e-3, 2.0), Slope(math.pi / 18.0, math.inf, 9.81)
    launch = State(0.0, 0.6, 0.7, 0.5, 0.0, 1.0)
    limits = Limits(3.0, 1e5, 1e-12, 0.01, 1e-4, 0.0, 12.0, 0.0, 1e6)
    compliant, rigid = ContactLaw(1e5, 0.5, 0.1, 1e-3, 1e-3), RigidLaw(0.5, 0.1, 1e-3, 1e-3, 1e-3)
    digest = hashlib.sha256()

    for law in (compliant, rigid, None):
        log, rows, outcomes = np.zeros(12, REBOUND), np.zeros(400, TRAJECTORY), np.zeros(1, OUTCOME)
        if law:
            for name, value in zip(State._fields, launch, strict=True):
                outcomes[name] = value
            tables = body, law, slope, launch, np.empty((0, 2)), outcomes, log[np.newaxis], rows
            run_lanes(law)(law, limits, *tables, new(SPACE), 1)
        else:
            run_euler(body, compliant, slope, launch, limits, log, new(CONTACT), rows, outcomes)
        for table in (log, rows, outcomes):
            digest.update(table.tobytes())
    return digest.hexdigest()


LIBRARY.known = _known
