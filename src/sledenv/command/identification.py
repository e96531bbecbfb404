"""The command that fits contact laws to recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import CoercionError, Group, Parameter, Token

from sledenv.command.arguments import POSITIVE, Count, FileToRead, Folder, Json, Seed, Solver, within
from sledenv.command.running import progress, taken, tell, working

if TYPE_CHECKING:
    import pandas as pd

    from sledenv.simulation.bodies import Body
    from sledenv.simulation.scene import Slope

Hypothesis = Literal["energetic", "poisson", "newton"]


def _fixed(_: Any, tokens: Sequence[Token]) -> list[tuple[str, float]]:
    pairs = []
    for token in tokens:
        name, _, value = token.value.partition("=")
        try:
            pairs.append((name, float(value)))
        except ValueError:
            raise CoercionError(msg=f"must be NAME=VALUE: {token.value!r}", token=token) from None
    return pairs


Fixed = Annotated[tuple[tuple[str, float], ...], Parameter(metavar="NAME=VALUE", converter=_fixed, n_tokens=1)]


@Parameter(name="*")
@dataclass(frozen=True)
class Shape:
    """Shape and inertia of a body.

    Parameters
    ----------
    gyration_radius
        Root of inertia over mass [m]; normal speeds alone do not need it.
    radius
        Of the arc [m] of a disc or a segment; a table with phi_rad needs it.
    eccentricity
        Of the mass centre in the arc [m].
    half_angle_deg
        Of the arc; 180 has no corners.
    """

    gyration_radius: Annotated[float | None, Parameter(metavar="M"), POSITIVE] = None
    radius: Annotated[float | None, Parameter(metavar="M"), POSITIVE] = None
    eccentricity: Annotated[float, Parameter(metavar="M"), within(1e9)] = 0.0
    half_angle_deg: Annotated[float, Parameter(metavar="DEG"), within(180.0)] = 180.0

    def body(self, mass: float) -> Body:
        """Return the body of this mass."""
        from sledenv.simulation.bodies import segment

        if self.radius is None:
            raise ValueError(
                "--radius: is missing, and phi_rad needs it: the radius of the arc [m] of a disc or a segment; "
                "any other body goes by sledenv.identify(FILE, body, ...) in Python"
            )
        if self.gyration_radius is None:
            raise ValueError("--gyration-radius: is missing: root of inertia over mass [m] of the disc or segment")
        inertia = mass * self.gyration_radius**2
        return segment(mass, self.radius, self.eccentricity, inertia, math.radians(self.half_angle_deg))


@Parameter(name="*", group=Group("For rebounds", sort_key=1))
@dataclass(frozen=True)
class Rebounds:
    """Options of a table of rebounds.

    Parameters
    ----------
    hypothesis
        Of restitution.
    softening
        Let the restitution depend on the approach speed.
    compare
        Cross-validate other laws too.
    folds
        Parts for that.
    starts
        Of the fit.
    """

    hypothesis: Hypothesis = "energetic"
    softening: bool = False
    compare: bool = False
    folds: Count = 10
    starts: Count = 16


@Parameter(name="*", group=Group("For poses over time", help="These need --radius and --slope-deg.", sort_key=2))
@dataclass(frozen=True)
class Tracks:
    """Options of poses over time.

    Parameters
    ----------
    slope_deg
        Inclination; x runs downhill.
    mass
        Stiffness is in proportion.
    surfaces
        Compliant fits a stiffness too.
    position_noise
        Standard deviation; default: estimated.
    angle_noise_deg
        The same of the orientation.
    """

    slope_deg: Annotated[float | None, Parameter(metavar="DEG"), within(89.0)] = None
    gravity: Annotated[float, Parameter(metavar="M_S2"), POSITIVE] = 9.81
    mass: Annotated[float, Parameter(metavar="KG"), POSITIVE] = 1.0
    surfaces: Solver = "rigid"
    position_noise: Annotated[float | None, Parameter(metavar="M"), POSITIVE] = None
    angle_noise_deg: Annotated[float | None, Parameter(metavar="DEG"), POSITIVE] = None

    def slope(self) -> Slope:
        """Return the slope."""
        from sledenv.simulation.scene import Slope

        if self.slope_deg is None:
            raise ValueError("--slope-deg: poses over time need it")
        return Slope(math.radians(self.slope_deg), gravity=self.gravity)

    def noise(self) -> tuple[float, float] | None:
        """Return the noise of positions [m] and angles [rad], None if it is to be estimated."""
        match self.position_noise, self.angle_noise_deg:
            case None, None:
                return None
            case float(position), float(angle):
                return position, math.radians(angle)
        raise ValueError("--position-noise, --angle-noise-deg: both must be given, or none")


_NO_SHAPE, _USUAL, _NO_TRACKS = Shape(), Rebounds(), Tracks()


def identify(
    file: FileToRead,
    /,
    *,
    shape: Shape = _NO_SHAPE,
    rebounds: Rebounds = _USUAL,
    tracks: Tracks = _NO_TRACKS,
    fix: Fixed = (),
    seed: Seed = 0,
    out: Folder | None = None,
    json: Json = False,
) -> None:
    """Fit a contact law to measured rebounds, or to poses over time.

    Fits restitution, friction and rolling arms to what was measured of one body, and prints them with their intervals.
    Columns of a table of rebounds, with their units: u_before_m_s, v_before_m_s, omega_before_rad_s, the same with
    after, and phi_rad or the arms a_m and b_m of the contact. Of a ball or a centred disc v_before_m_s and v_after_m_s
    alone tell the restitution, and so do times of touchdown, t_touchdown_s. Of poses over time: t_s, x_m, y_m and
    phi_rad, in the frame of the slope. recording, which tells recordings apart, is optional.

    Here phi_rad is that of a disc or a segment, which --radius, --eccentricity and --half-angle-deg tell. Of any other
    body give the arms, or call sledenv.identify(FILE, body) in Python, which takes each Body.

    Parameters
    ----------
    file
        That ends in .csv or .parquet.
    fix
        Do not fit this parameter: restitution, friction, rolling_arm, corner_rolling_arm; may be repeated.
    seed
        Of starts and folds.
    out
        Write tables and figures into this folder.
    """
    from sledenv.identification.choice import holds_tracks
    from sledenv.identification.tables import read_table
    from sledenv.machine.files import publish

    table = read_table(file)
    if holds_tracks(table):
        files, fit = _of_tracks(table, shape, tracks, fixed=dict(fix), seed=seed)
    else:
        files, fit = _of_rebounds(table, shape, rebounds, fixed=dict(fix), seed=seed)
    with ExitStack() as places:
        folder = out and taken(places, "--out", publish(out, files))
        with working("identify"):
            text, data, write = fit()
        if folder:
            write(folder)
    tell(text + (f"\nidentify: wrote {out}" if out else ""), data | {"written": [out] if out else []}, json)


# What is written, and the fit: its words, its data, and what writes it into a folder.
_Fit = tuple[Collection[str], Callable[[], tuple[str, dict[str, Any], Callable[[Path], None]]]]


def _of_rebounds(table: pd.DataFrame, shape: Shape, how: Rebounds, fixed: dict[str, float], seed: int) -> _Fit:
    from sledenv.identification.comparison import compare
    from sledenv.identification.plausibility import doubts, read_rebounds
    from sledenv.identification.rebound_fit import identify
    from sledenv.identification.rebounds import AFTER, ARMS, BEFORE, POSE
    from sledenv.identification.report import COMPARED, FILES, write_identification

    if shape.gyration_radius is None and any(name in table for name in (BEFORE[2], AFTER[2])):
        raise ValueError("--gyration-radius: is missing, and spins need it: root of inertia over mass [m]")
    by_arms = shape.radius is None and (POSE[0] not in table or any(name in table for name in ARMS))
    body = None if by_arms else shape.body(1.0)
    radius = None if body else shape.gyration_radius
    warn = progress("identify: warning")
    for doubt in doubts(read_rebounds(table, body, gyration_radius=radius)):  # a fit may take long
        warn(doubt)

    def fit() -> tuple[str, dict[str, Any], Callable[[Path], None]]:
        found = identify(
            table,
            body,
            gyration_radius=radius,
            hypothesis=how.hypothesis,
            fixed=fixed,
            speed_dependent=how.softening,
            starts=how.starts,
            seed=seed,
        )
        text, data = str(found), {"parameters": found.table, "warnings": found.warnings}
        compared = compare(found.rebounds, folds=how.folds, seed=seed) if how.compare else None
        if compared is not None:
            data |= {"models": compared.table, "differences": compared.differences()}
            text += f"\n\nerrors on rebounds held out\n{data['models'].round(4).to_string()}"
            text += f"\n\nand how much larger than the best\n{data['differences'].round(4).to_string()}"
        return text, data, lambda folder: write_identification(found, folder, compared)

    return (*FILES, *COMPARED), fit


def _of_tracks(table: pd.DataFrame, shape: Shape, how: Tracks, fixed: dict[str, float], seed: int) -> _Fit:
    from sledenv.identification.report import track_files, write_tracks
    from sledenv.identification.tables import numbered, recorded_names
    from sledenv.identification.tracks import identify_tracks

    body, slope, noise = shape.body(how.mass), how.slope(), how.noise()

    def fit() -> tuple[str, dict[str, Any], Callable[[Path], None]]:
        found = identify_tracks(table, body, slope, solver=how.surfaces, fixed=fixed, noise=noise, seed=seed)
        launches = {name: launch._asdict() for name, launch in found.launches.items()}
        tables = {"recordings": found.used, "parameters": found.table}
        data = tables | {"launches": launches, "warnings": found.warnings}
        return str(found), data, lambda folder: write_tracks(found, folder)

    names = recorded_names(numbered(table))
    return track_files(1 if names is None else names.nunique()), fit
