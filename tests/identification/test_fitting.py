"""Robust least squares: closed forms of straight lines, bounds, outliers, local minima, coverage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from sledenv.identification.fitting import LocalMinimumError, bootstrap, profiled, solve
from sledenv.identification.objective import Parameter, Problem

LINE = (Parameter("slope", "m/s", -5.0, 5.0, 1.0), Parameter("height", "m", -10.0, 10.0, 1.0))


def line(rng: np.random.Generator, n: int = 40, slope: float = 1.5, noise: float = 0.1, **options) -> Problem:
    """Points of a straight line that stands at 2, with noise."""
    x = rng.uniform(-1.0, 1.0, n)
    y = slope * x + 2.0 + noise * rng.normal(size=n)
    return Problem(options.pop("parameters", LINE), lambda values: values[0] * x + values[1] - y, **options)


def textbook(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Least squares of a straight line, and its standard errors."""
    at = np.zeros(2)
    y = -problem.rows(at)[:, 0]
    design = np.stack([problem.rows(np.eye(2)[k])[:, 0] + y for k in range(2)], axis=1)
    values = np.linalg.lstsq(design, y)[0]
    variance = np.sum((design @ values - y) ** 2) / (len(y) - 2)
    return values, np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * variance)


def test_a_line_of_one_recording_has_the_textbooks_intervals() -> None:
    """Oracle: the normal equations and Student's distribution."""
    problem = replace(line(np.random.default_rng(1)), loss="linear", clusters=np.zeros(40))
    fit = solve(problem, starts=3)
    values, errors = textbook(problem)
    assert fit.covariance_kind == "model"
    assert fit.vector == pytest.approx(values, rel=1e-7)
    assert list(fit.errors.values()) == pytest.approx(errors, rel=1e-5)
    for name, value, error in zip(problem.names, values, errors, strict=True):
        interval = fit.interval(name, 0.9)
        reach = stats.t.ppf(0.95, 38) * error
        assert interval[:2] == pytest.approx((value - reach, value + reach), rel=1e-5)
        assert not interval.low_on_bound
        assert not interval.high_on_bound


def test_the_sandwich_is_the_one_of_white() -> None:
    """Oracle: (X'X)^-1 X' diag(r^2) X (X'X)^-1, with the factor n/(n - p)."""
    problem = replace(line(np.random.default_rng(2)), loss="linear")
    fit = solve(problem, starts=1)
    rows = problem.rows(fit.vector)[:, 0]
    design = np.stack([problem.rows(fit.vector + np.eye(2)[k])[:, 0] - rows for k in range(2)], axis=1)
    bread = np.linalg.inv(design.T @ design)
    white = bread @ (design.T * rows**2) @ design @ bread * 40 / 38
    assert fit.covariance_kind == "sandwich"
    assert fit.covariance.to_numpy() == pytest.approx(white, rel=1e-5)


def test_a_row_counts_as_a_whole() -> None:
    """Oracle: the formula of the loss; a rotation of the components of a row changes nothing."""
    rows = np.random.default_rng(3).normal(size=(7, 2))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    parameters = (Parameter("x", "", 0.0, 1.0, 1.0),)
    costs = [Problem(parameters, lambda _, r=r: r, loss_scale=0.5).cost(np.zeros(1)) for r in (rows, rows @ turn)]
    plain = np.sum(0.25 * (np.sqrt(1.0 + np.sum(rows**2, axis=1) / 0.25) - 1.0))
    assert costs == pytest.approx([plain, plain], rel=1e-12)


def test_the_gradient_and_the_hessian_are_those_of_the_cost() -> None:
    """Oracle: differences of the cost, in a problem whose residuals are linear."""
    problem = line(np.random.default_rng(4), loss_scale=0.2)
    at, h = np.array([1.0, 2.2]), 1e-3
    scores, hessian = problem.scores(at)
    steps = h * np.eye(2)
    assert scores.sum(axis=0) == pytest.approx(
        [(problem.cost(at + s) - problem.cost(at - s)) / (2 * h) for s in steps], rel=1e-4
    )
    mixed = [
        [
            (problem.cost(at + s + t) - problem.cost(at + s - t) - problem.cost(at - s + t) + problem.cost(at - s - t))
            / (4 * h * h)
            for s in steps
        ]
        for t in steps
    ]
    assert hessian == pytest.approx(np.array(mixed), rel=1e-3)


def test_outliers_hardly_move_a_robust_fit() -> None:
    rng = np.random.default_rng(5)
    x = rng.uniform(-1, 1, 60)
    y = 1.5 * x + 2 + 0.02 * rng.normal(size=60)
    y[:6] += 5.0
    problem = Problem(LINE, lambda v: v[0] * x + v[1] - y, loss_scale=0.05)
    robust, square = solve(problem, starts=2), solve(replace(problem, loss="linear"), starts=2)
    assert robust.vector == pytest.approx([1.5, 2.0], abs=0.03)
    assert abs(square.values["height"] - 2.0) > 0.3


def test_a_second_minimum_is_seen() -> None:
    """Oracle: (x^2 - 1)^2 + .04 (x - 1)^2 is least at 1; x (x + 1) = -.02 beside -1 is a local minimum."""
    problem = Problem(
        (Parameter("x", "", -2.0, 1.1, 1.0),),
        lambda v: np.array([v[0] ** 2 - 1.0, 0.2 * (v[0] - 1.0), 1.0, -1.0]),
        clusters=np.zeros(4),
        loss="linear",
    )
    fit = solve(problem, {"x": -1.5}, starts=12)
    other = -0.5 - np.sqrt(0.25 - 0.02)
    assert fit.values["x"] == pytest.approx(1.0, abs=1e-6)
    minima = fit.minima
    assert minima["end_x"].tolist() == pytest.approx([1.0, other], abs=1e-5)
    assert minima["found"].sum() == fit.starts["converged"].sum() == 12
    alone = solve(problem, {"x": -1.5}, starts=1)
    assert alone.values["x"] == pytest.approx(other, abs=1e-5)
    with pytest.raises(LocalMinimumError, match="below"):
        alone.interval("x")
    again, intervals = profiled(alone)
    assert again.values == pytest.approx(fit.values)
    assert len(again.starts) == 2
    assert intervals["x"][:2] == pytest.approx(fit.interval("x")[:2])


def test_a_parameter_on_its_bound_is_exactly_there_and_has_a_one_sided_interval() -> None:
    parameters = (LINE[0]._replace(low=0.0), LINE[1])
    problem = line(np.random.default_rng(6), slope=-0.02, noise=0.5, parameters=parameters)
    fit = solve(problem, starts=4)
    assert fit.values["slope"] == 0.0
    assert fit.on_bound == {"slope": 0.0}
    assert np.isnan(fit.errors["slope"])
    interval = fit.interval("slope")
    assert interval.low == 0.0
    assert interval.low_on_bound
    assert 0.0 < interval.high < 1.0
    assert fit.errors["height"] == pytest.approx(0.5 / np.sqrt(40), rel=0.4)


def test_what_the_data_say_nothing_of_has_its_bounds_as_interval() -> None:
    problem = line(np.random.default_rng(7), parameters=(*LINE, Parameter("idle", "", 0.0, 1.0, 1.0)))
    fit = solve(problem, starts=3)
    interval = fit.interval("idle")
    assert interval == (0.0, 1.0, 0.95, True, True)
    assert fit.interval("slope").high < 2.0


def test_exact_data_leave_hardly_an_interval() -> None:
    fit = solve(line(np.random.default_rng(8), noise=0.0), starts=2)
    low, high, *_ = fit.interval("slope")
    assert low == pytest.approx(1.5, abs=1e-6)
    assert high == pytest.approx(1.5, abs=1e-6)


def test_a_fixed_parameter_stays() -> None:
    fit = solve(line(np.random.default_rng(9), fixed={"height": 2.0}), starts=2)
    assert fit.values["height"] == 2.0
    assert list(fit.errors) == ["slope"]
    assert fit.values["slope"] == pytest.approx(1.5, abs=0.1)
    cost, values = fit.held(slope=1.0)
    assert values == {"slope": 1.0, "height": 2.0}
    assert cost == pytest.approx(fit.problem.cost(np.array([1.0, 2.0])))


@pytest.mark.parametrize(("slope", "least"), [pytest.param(1.5, 0.87, marks=pytest.mark.slow), (0.0, 0.9)])
def test_intervals_cover_at_their_level(slope: float, least: float) -> None:
    """At level .95, of 60 lines of 12 recordings whose points share an error; slope >= 0, so that 0 is a bound."""
    rng = np.random.default_rng(10)
    parameters = (LINE[0]._replace(low=0.0), LINE[1])
    covered = 0
    for _ in range(60):
        recording = np.repeat(np.arange(12), 5)
        x = rng.uniform(-1, 1, 60)
        y = slope * x + 2 + 0.1 * rng.normal(size=60) + (0.1 * rng.normal(size=12))[recording]
        problem = Problem(parameters, lambda v, x=x, y=y: v[0] * x + v[1] - y, clusters=recording, loss_scale=0.3)
        interval = solve(problem, {"slope": 1.0, "height": 1.0}, starts=1).interval("slope")
        covered += interval.low <= slope <= interval.high
    assert least <= covered / 60 <= 1.0
    if slope > 0.0:
        assert covered < 60


def test_the_bootstrap_agrees_with_the_sandwich() -> None:
    """With errors that recordings share, so that rows alone would say too little."""
    rng = np.random.default_rng(11)
    recording = np.repeat(np.arange(30), 4)
    x = rng.uniform(-1, 1, 120)
    y = 1.5 * x + 2 + 0.05 * rng.normal(size=120) + (0.2 * rng.normal(size=30))[recording]
    fit = solve(Problem(LINE, lambda v: v[0] * x + v[1] - y, clusters=recording), starts=1)
    drawn = bootstrap(fit, 150, seed=3)
    assert drawn.shape == (150, 2)
    assert drawn["height"].std() == pytest.approx(fit.errors["height"], rel=0.2)
    alone = solve(replace(fit.problem, clusters=None), starts=1)
    assert fit.errors["height"] > 1.5 * alone.errors["height"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fixed": {"height": 11.0}}, r"fixed.height = 11.0: must be in \[-10, 10\] m"),
        ({"fixed": {"mass": 1.0}}, "'mass' is no parameter: must be one of slope, height"),
        ({"fixed": {"slope": 1.0, "height": 1.0}}, "must leave a parameter to fit"),
        ({"loss_scale": 0.0}, "loss_scale = 0.0"),
        ({"loss": "cauchy"}, "loss = 'cauchy'"),
        ({"parameters": (LINE[0]._replace(low=9.0), LINE[1])}, "slope: bounds"),
        ({"residuals": lambda values: np.array([1.0, np.nan])}, "residuals of row 1"),
    ],
)
def test_what_is_wrong_is_named(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solve(replace(line(np.random.default_rng(12)), **change), starts=1)


def test_a_wrong_start_is_named() -> None:
    problem = line(np.random.default_rng(12))
    with pytest.raises(ValueError, match=r"start.slope = 6.0: must be in \[-5, 5\] m/s"):
        solve(problem, {"slope": 6.0, "height": 0.0})
    with pytest.raises(ValueError, match=r"start\.height = nan"):
        solve(problem, {"slope": 1.0})
    with pytest.raises(ValueError, match="'mass' is not fitted"):
        solve(problem, starts=1).interval("mass")
    with pytest.raises(ValueError, match="at least two recordings"):
        bootstrap(solve(replace(problem, clusters=np.zeros(40)), starts=1))
