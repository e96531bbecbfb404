"""Restitution, friction and rolling arms of one body from a table of its rebounds: :func:`identify`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sledenv.identification.fitting import Fit, profiled, solve
from sledenv.identification.intervals import Interval
from sledenv.identification.objective import Floats, Loss, Parameter, Problem
from sledenv.kernel.records import ARC
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis, velocities_after
from sledenv.simulation.rules import POSITIVE, checked, checked_choice, made
from sledenv.simulation.support import arms, feature_at, within_a_turn

BEFORE: Final = ("u_before_m_s", "v_before_m_s", "omega_before_rad_s")
AFTER: Final = ("u_after_m_s", "v_after_m_s", "omega_after_rad_s")
POSE: Final = ("phi_rad",)
ARMS: Final = ("a_m", "b_m")
RECORDING: Final = "recording"

_MOST_FRICTION = 2.0
_MOST_SOFTENING = 1.0
_LOSS_SCALE = 0.1  # relative to the speed before
_USUAL = {"restitution": 0.5, "friction": 0.2}  # where the first start begins; arms and softening from 0
_UNBALANCED = 0.5  # share of a moment below which its arm is doubted
_SURE = 4.0  # standard errors
_STARTS = 16
_FEW_STARTS = 8  # of each part of the data in a comparison


@dataclass(frozen=True)
class Rebounds:
    """Measured rebounds of one body, checked.

    Attributes
    ----------
    gyration_radius : float
        Root of inertia over mass [m]; the mass itself cancels.
    contacts : ndarray, shape (N, 5)
        Arms a, b [m], and u, v [m/s], omega [rad/s] before.
    after : ndarray, shape (N, 3)
        u, v [m/s], omega [rad/s].
    corner : ndarray of bool, shape (N,)
        Whether a corner touched.
    recordings : ndarray, shape (N,)
        Which recording each is of.
    """

    gyration_radius: float
    contacts: Floats
    after: Floats
    corner: NDArray[np.bool_]
    recordings: NDArray[np.generic]

    def __len__(self) -> int:
        return len(self.contacts)

    def rows(self, chosen: NDArray[np.generic]) -> Rebounds:
        """Return some of the rebounds, by a mask or by their numbers."""
        return replace(
            self,
            contacts=self.contacts[chosen],
            after=self.after[chosen],
            corner=self.corner[chosen],
            recordings=self.recordings[chosen],
        )

    @property
    def arms(self) -> Floats:
        """Arms a and b [m], shape (N, 2)."""
        return self.contacts[:, :2]

    @property
    def before(self) -> Floats:
        """Velocities u, v [m/s] and omega [rad/s], shape (N, 3)."""
        return self.contacts[:, 2:]

    @property
    def scales(self) -> Floats:
        """What makes velocities comparable: square roots of M over the mass, (1, 1, radius of gyration)."""
        return np.array([1.0, 1.0, self.gyration_radius])

    @cached_property
    def speed(self) -> Floats:
        """Root of ``v' M v / m`` before [m/s], shape (N,): the kinetic energy as a speed."""
        speed: Floats = np.sqrt(np.sum((self.before * self.scales) ** 2, axis=1))
        return speed

    @property
    def approach(self) -> Floats:
        """Speed [m/s] at which the gap closes, shape (N,)."""
        return self.contacts[:, 0] * self.contacts[:, 4] - self.contacts[:, 3]

    def residuals(self, velocities: Floats) -> Floats:
        """Differences from the velocities after, shape (N, 3), in the energy norm and relative to the speed before."""
        found: Floats = (velocities - self.after) * self.scales / self.speed[:, None]
        return found

    def errors(self, velocities: Floats) -> Floats:
        """Root of ``dv' M dv / v0' M v0``, shape (N,)."""
        found: Floats = np.linalg.norm(self.residuals(velocities), axis=1)
        return found

    def balance(self) -> pd.DataFrame:
        """Compare the recorded spins with the moments of the recorded impulses about the arms, whatever the law.

        The moment of the normal impulse is ``-a P``, that of the tangential one ``b S``. A law without rolling
        resistance leaves the spin no other source, so that the shares found here, by least squares, are 1 each, and
        near it where rolling resistance is small. A share that is far off, or negative, means that an arm, the spin or
        the radius of gyration is told wrongly, in its sign or in its unit: no contact law makes good for that.

        Returns
        -------
        DataFrame
            Rows ``a`` and ``b``: ``share`` [-] and its standard ``error``, NaN where that arm does not turn the body.
        """
        change = self.after - self.before
        moments = np.stack([-self.arms[:, 0] * change[:, 1], self.arms[:, 1] * change[:, 0]], axis=1)
        spin = self.gyration_radius**2 * change[:, 2]
        told = np.linalg.norm(moments, axis=0) > 1e-9 * np.linalg.norm(spin)
        found = pd.DataFrame(np.nan, ["a", "b"], ["share", "error"])
        if told.any() and len(self) > 2:
            design = moments[:, told]
            shares = np.linalg.lstsq(design, spin)[0]
            inverse = np.linalg.pinv(design.T @ design, hermitian=True)
            scores = design * (spin - design @ shares)[:, None]
            spread = inverse @ (scores.T @ scores) @ inverse
            found.loc[told, "share"], found.loc[told, "error"] = shares, np.sqrt(np.diag(spread))
        return found


@dataclass(frozen=True)
class ImpactModel:
    """How rebounds follow from parameters, and which of these are not fitted.

    Attributes
    ----------
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means: docs/physics.md, section 4.
    fixed : dict
        Values of parameters that are not fitted.
    reference_speed : float
        Approach speed [m/s] at which the restitution is ``restitution``. With a ``softening`` q it is
        ``restitution (v/reference_speed)^-q`` at the approach speed v, at most 1: the power law of the theory of
        plastic impact, in which q is 1/4 (Johnson 1985, Contact Mechanics, section 11.5).
    """

    hypothesis: Hypothesis = "energetic"
    fixed: Mapping[str, float] = field(default_factory=lambda: {"softening": 0.0})
    reference_speed: float = 1.0

    def parameters(self, gyration_radius: float) -> tuple[Parameter, ...]:
        """What may be fitted; an arm of rolling resistance is at most the radius of gyration."""
        k = gyration_radius
        return (
            Parameter("restitution", "", 0.0, 1.0, 0.1),
            Parameter("friction", "", 0.0, _MOST_FRICTION, 0.1),
            Parameter("rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("corner_rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("softening", "", -_MOST_SOFTENING, _MOST_SOFTENING, 0.1),
        )

    def velocities(self, rebounds: Rebounds, values: Floats) -> Floats:
        """Velocities after, shape (N, 3): u, v [m/s], omega [rad/s]; for values of all parameters in their order."""
        e, friction, arm, corner_arm, softening = values
        laws = np.empty((len(rebounds), 3))
        laws[:, 0] = e
        if softening != 0.0:
            laws[:, 0] = np.minimum(e * (rebounds.approach / self.reference_speed) ** -softening, 1.0)
        laws[:, 1] = friction
        laws[:, 2] = np.where(rebounds.corner, corner_arm, arm)
        return velocities_after(rebounds.gyration_radius, rebounds.contacts, laws, self.hypothesis)

    def __call__(self, train: Rebounds, test: Rebounds) -> Floats:
        """Fit to some rebounds and predict the velocities after others, shape (N, 3)."""
        return self.velocities(test, self.fit(train, starts=_FEW_STARTS).vector)

    def fit(
        self,
        rebounds: Rebounds,
        start: Mapping[str, float] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        loss: Loss = "soft_l1",
        loss_scale: float = _LOSS_SCALE,
        starts: int = _STARTS,
        seed: int = 0,
    ) -> Fit:
        """Fit the parameters that are not fixed; the arguments are those of :func:`identify`."""
        unused = {} if rebounds.corner.any() else {"corner_rolling_arm": 0.0}
        if rebounds.corner.all():
            unused = {"rolling_arm": 0.0}
        limits = dict(bounds or {})
        parameters = self.parameters(rebounds.gyration_radius)
        for name in limits:
            if name not in [one.name for one in parameters]:
                raise ValueError(f"bounds: {name!r} is no parameter")
        problem = Problem(
            [one._replace(low=low, high=high) for one in parameters for low, high in [limits.get(one.name, one[2:4])]],
            lambda values: rebounds.residuals(self.velocities(rebounds, values)),
            {**unused, **self.fixed},
            rebounds.recordings,
            loss,
            loss_scale,
        )
        usual = {one.name: min(max(_USUAL.get(one.name, 0.0), one.low), one.high) for one in problem.parameters}
        return solve(problem, {**usual, **(start or {})}, starts=starts, seed=seed)


@dataclass(frozen=True)
class Identification:
    """A contact law that was fitted to rebounds, and how sure one may be of it.

    Attributes
    ----------
    rebounds : Rebounds
    model : ImpactModel
    fit : Fit
        With the values, their covariance and all starts.
    intervals : dict
        Profile interval of each fitted parameter, of the level .95.
    """

    rebounds: Rebounds
    model: ImpactModel
    fit: Fit
    intervals: Mapping[str, Interval]

    @property
    def values(self) -> dict[str, float]:
        """Of all parameters, those included that were not fitted."""
        return self.fit.values

    @cached_property
    def velocities(self) -> Floats:
        """Velocities after, as the fit has them, shape (N, 3): u, v [m/s], omega [rad/s]."""
        return self.model.velocities(self.rebounds, self.fit.vector)

    @property
    def errors(self) -> Floats:
        """Of each rebound, root of ``dv' M dv / v0' M v0``, shape (N,)."""
        return self.rebounds.errors(self.velocities)

    def predict(self, table: pd.DataFrame | str | os.PathLike[str], body: Body | None = None) -> Floats:
        """Velocities after other impacts of this body, shape (N, 3): u, v [m/s], omega [rad/s].

        Parameters
        ----------
        table, body
            As for :func:`identify`; velocities after need not be there.
        """
        gyration = None if body is not None else self.rebounds.gyration_radius
        return self.model.velocities(
            read_rebounds(table, body, gyration_radius=gyration, measured=False), self.fit.vector
        )

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a parameter: ``value``, ``error``, ``low`` and ``high`` of the interval, ``unit``, ``note``."""
        rows = []
        for one in self.fit.problem.parameters:
            if one.name in self.fit.problem.free:
                low, high, _, low_on_bound, high_on_bound = self.intervals[one.name]
                ends = [f"{end} end is its bound" for end, on in (("low", low_on_bound), ("high", high_on_bound)) if on]
                rows.append((self.values[one.name], self.fit.errors[one.name], low, high, one.unit, ", ".join(ends)))
            else:
                rows.append((self.values[one.name], np.nan, np.nan, np.nan, one.unit, "not fitted"))
        columns = ["value", "error", "low", "high", "unit", "note"]
        return pd.DataFrame(rows, pd.Index(self.fit.problem.names, name="parameter"), columns)

    @cached_property
    def warnings(self) -> list[str]:
        """What casts doubt on the result, a sentence each."""
        return [*_doubts(self.rebounds), *self._doubts()]

    def _doubts(self) -> Iterable[str]:
        for name, interval in self.intervals.items():
            if interval.low_on_bound and interval.high_on_bound:
                yield f"these rebounds say nothing of {name}: every value in its bounds is as good"
            elif name in self.fit.on_bound:
                yield f"{name} is on its bound, {self.values[name]:g}: its interval is one-sided"
        minima = self.fit.minima
        failed = len(self.fit.starts) - int(self.fit.starts["converged"].sum())
        if failed:
            yield f"{failed} of {len(self.fit.starts)} starts did not converge"
        for _, other in minima.iloc[1:].iterrows():
            places = ", ".join(f"{name} {other[f'end_{name}']:.4g}" for name in self.fit.problem.free)
            rise = other["cost"] / self.fit.cost - 1.0 if self.fit.cost > 0.0 else math.inf
            yield (
                f"{int(other['found'])} of {len(self.fit.starts)} starts ended in another minimum, at {places}, "
                f"whose cost is higher by {100.0 * rise:.2g} %"
            )

    def __str__(self) -> str:
        """Return the result for a reader: what was fitted, the parameters, the errors, what to doubt."""
        count, recordings = len(self.rebounds), len(np.unique(self.rebounds.recordings))
        mean, tail = np.mean(self.errors), np.quantile(self.errors, 0.9)
        lines = [
            f"{count} rebounds of {recordings} recordings, {self.model.hypothesis} restitution"
            + (f" at {self.model.reference_speed:.3g} m/s" if "softening" not in self.model.fixed else ""),
            "",
            f"{'':<20}{'value':>11}  {'95 % interval':^25} unit",
        ]
        for name, row in self.table.iterrows():
            reach = "" if row["note"] == "not fitted" else f"[{row['low']:.5g}, {row['high']:.5g}]"
            lines.append(f"{name!s:<20}{row['value']:>11.5g}  {reach:^25} {row['unit']:<4} {row['note']}".rstrip())
        lines += ["", f"error of the fit, relative to the speed before: mean {mean:.4f}, 90th percentile {tail:.4f}"]
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])


def _doubts(rebounds: Rebounds) -> Iterable[str]:
    """What is strange about measured rebounds, whatever the law."""
    for name, (share, error) in rebounds.balance().iterrows():
        if share < _UNBALANCED and share + _SURE * error < 1.0:
            yield (
                f"the spins do not balance: they change by {share:.2f} +- {error:.2f} times the moment of the impulse "
                f"at the arm {name}, not by 1 times; is the sign of an arm, of omega or of u told wrongly, or a unit?"
            )
    opening = rebounds.after[:, 1] - rebounds.arms[:, 0] * rebounds.after[:, 2]
    energy = np.sum((rebounds.after * rebounds.scales) ** 2, axis=1)
    for what, rows in (
        ("still approach afterwards", opening < 0.0),
        ("have more energy after than before", energy > rebounds.speed**2),
    ):
        if rows.any():
            yield f"{np.count_nonzero(rows)} rebounds {what}, the first of them in row {int(np.argmax(rows))}"


def identify(
    table: pd.DataFrame | str | os.PathLike[str],
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    hypothesis: Hypothesis = "energetic",
    fixed: Mapping[str, float] | None = None,
    speed_dependent: bool = False,
    start: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    loss: Loss = "soft_l1",
    loss_scale: float = _LOSS_SCALE,
    starts: int = _STARTS,
    seed: int = 0,
) -> Identification:
    """Fit restitution, friction and rolling arms to measured rebounds of one body.

    Parameters
    ----------
    table : DataFrame or path
        One row a rebound, a CSV or Parquet file if a path. Columns ``u_before_m_s``, ``v_before_m_s``,
        ``omega_before_rad_s``, the same with ``after``, and either ``phi_rad``, the orientation of ``body``, or the
        arms ``a_m`` and ``b_m`` of the contact point, which lies at (-a, -b) from the mass centre. The frame is that
        of the slope: x along it, y along its outward normal, angles counter-clockwise. ``recording``, if it is there,
        names the recording: rebounds of one may share their errors. Other columns are not read.
    body : Body, optional
        Whose rebounds they are. The mass cancels.
    gyration_radius : float, optional
        Root of inertia over mass [m] of any other smooth body, told by its arms.
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means.
    fixed : mapping, optional
        Values of parameters that are not to be fitted: ``restitution``, ``friction``, ``rolling_arm`` [m] of the arc,
        ``corner_rolling_arm`` [m], ``softening``.
    speed_dependent : bool
        Whether ``softening`` is fitted as well, see :class:`ImpactModel`; the restitution is then that at the median
        approach speed. It is 0 otherwise.
    start : mapping, optional
        Where the first start begins.
    bounds : mapping, optional
        (low, high) of parameters in place of the usual ones.
    loss : {"soft_l1", "linear"}
        Robust, or least squares.
    loss_scale : float
        Error, relative to the speed before, from which on a rebound begins to count as an outlier.
    starts, seed
        As for :func:`sledenv.identification.fitting.solve`.

    Returns
    -------
    Identification

    Raises
    ------
    TypeError, ValueError
        Naming the column, row or argument, its value and what is allowed.
    OSError
        If the file cannot be read.
    """
    checked_choice("hypothesis", hypothesis, get_args(Hypothesis))
    rebounds = read_rebounds(table, body, gyration_radius=gyration_radius)
    held = {**({} if speed_dependent else {"softening": 0.0}), **(fixed or {})}
    speed = float(np.median(rebounds.approach)) if "softening" not in held else 1.0
    model = ImpactModel(hypothesis, held, speed)
    fit = model.fit(rebounds, start, bounds=bounds, loss=loss, loss_scale=loss_scale, starts=starts, seed=seed)
    return Identification(rebounds, model, *profiled(fit))


def read_rebounds(
    table: pd.DataFrame | str | os.PathLike[str],
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    measured: bool = True,
) -> Rebounds:
    """Check a table of rebounds, see :func:`identify`; with ``measured`` false velocities after need not be there.

    Raises
    ------
    TypeError, ValueError
        Naming the column, row or argument, its value and what is allowed.
    OSError
        If the file cannot be read.
    """
    if (body is None) == (gyration_radius is None):
        raise ValueError("body, gyration_radius: one of them must be given, and one only")
    if not isinstance(table, pd.DataFrame):
        table = read_table(table)
    if not len(table):
        raise ValueError("the table has no rows")
    before = _columns(table, BEFORE)
    after = _columns(table, AFTER) if measured else np.full_like(before, np.nan)
    if body is not None:
        body = made("body", Body, body)
        k = math.sqrt(body.inertia / body.mass)
        reach, corner = arms_of(body, _columns(table, POSE)[:, 0])
    else:
        k = checked("identify", "gyration_radius", gyration_radius, POSITIVE)
        reach, corner = _columns(table, ARMS), np.zeros(len(table), bool)
    recordings = table[RECORDING].to_numpy() if RECORDING in table else np.arange(len(table))
    if pd.isna(recordings).any():
        raise ValueError(f"{RECORDING}, row {int(np.argmax(pd.isna(recordings)))}: there is no value")
    found = Rebounds(k, np.hstack([reach, before]), after, corner, pd.factorize(recordings)[0])
    leaving = found.approach <= 0.0
    if leaving.any():
        row = int(np.argmax(leaving))
        raise ValueError(
            f"row {row}: the gap opens at {-found.approach[row]:.4g} m/s before the impact, where it must close "
            f"(v_before - a omega_before < 0); {np.count_nonzero(leaving)} such rows are no rebounds"
        )
    return found


def read_table(place: str | os.PathLike[str]) -> pd.DataFrame:
    """Read a CSV or Parquet file, or raise OSError or ValueError."""
    file = Path(place)
    kind = file.suffix.lower()
    if kind not in (".csv", ".parquet"):
        raise ValueError(f"{file}: must end in .csv or .parquet")
    try:
        return _read_csv(file) if kind == ".csv" else pd.read_parquet(file)
    except OSError as error:
        raise OSError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # of pandas and of pyarrow, whose errors are this one as well
        raise ValueError(f"{file} is no table: {error}") from error


def _read_csv(file: Path) -> pd.DataFrame:
    table = pd.read_csv(file)
    if len(table.columns) == 1:  # as spreadsheets write them where the comma is the decimal sign
        for sign, name in ((";", "semicolons"), ("\t", "tabs")):
            if sign in str(table.columns[0]):
                raise ValueError(f"{name} separate its columns: commas must, and numbers have a decimal point")
    return table


def numbers(table: pd.DataFrame, name: str) -> Floats:
    """Return a column as floats, NaN where there is nothing, or raise ValueError naming column, row and value."""
    column = table[name]
    kinds = pd.api.types
    text = kinds.is_object_dtype(column) or kinds.is_string_dtype(column)
    if not text and (kinds.is_bool_dtype(column) or not kinds.is_numeric_dtype(column)):
        raise ValueError(f"{name}: must be numbers, is of the type {column.dtype}")
    found = pd.to_numeric(column, errors="coerce") if text else column
    wrong = (found.isna() & column.notna()).to_numpy()
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(f"{name}, row {row}: is {column.iloc[row]!r}, must be a number, with a decimal point")
    floats: Floats = found.to_numpy(float, na_value=np.nan)
    return floats


def _columns(table: pd.DataFrame, names: tuple[str, ...]) -> Floats:
    for name in names:
        if name not in table:
            raise ValueError(f"{name}: there is no such column{_alike(name, table)}")
    found = np.stack([numbers(table, name) for name in names], axis=-1)
    if not np.isfinite(found).all():
        row, column = (int(place[0]) for place in np.nonzero(~np.isfinite(found)))
        raise ValueError(f"{names[column]}, row {row}: is {found[row, column]}, must be a finite number")
    return found


def _alike(name: str, table: pd.DataFrame) -> str:
    """What the table has in place of a column: the same quantity without its unit or in another one."""
    stem = name.removesuffix("_rad_s").removesuffix("_m_s").removesuffix("_rad").removesuffix("_m")
    near = [str(other) for other in table.columns if str(other) == stem or str(other).startswith(f"{stem}_")]
    if near:
        return f", but {near[0]}: a column is named with its unit, and this one must be in that of {name}"
    return f"; the table has {', '.join(map(str, table.columns))}"


def arms_of(body: Body, phi: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Arms [m] at orientations [rad], (N, 2), and whether a corner touches, (N,)."""
    local = within_a_turn(phi).tolist()
    features = [feature_at(body, one) for one in local]
    found = np.array([arms(body, feature, one) for feature, one in zip(features, local, strict=True)])
    return found, np.array(features) != ARC
