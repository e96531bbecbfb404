"""Robust least squares: closed forms of straight lines, bounds, outliers, local minima, coverage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from sledenv.identification.fitting import LocalMinimumError, Parameter, Problem, profiled, solve

LINE = (Parameter("slope", "m/s", -5.0, 5.0, 1.0), Parameter("height", "m", -10.0, 10.0, 1.0))


def line(seed: int, slope: float = 1.5, noise: float = 0.1, parameters: tuple = LINE, **options) -> Problem:
    """Forty points of a straight line that stands at 2, with noise."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, 40)
    y = slope * x + 2.0 + noise * rng.normal(size=40)
    return Problem(parameters, lambda values: values[0] * x + values[1] - y, **options)


def design(problem: Problem) -> np.ndarray:
    """Derivatives of the residuals of a line."""
    return np.stack([problem.rows(np.eye(2)[k]) - problem.rows(np.zeros(2)) for k in range(2)], axis=1)[:, :, 0]


def test_a_line_of_one_recording_has_the_textbooks_intervals() -> None:
    """Oracle: the normal equations and Student's distribution."""
    problem = line(1, loss="linear", clusters=np.zeros(40))
    fit = solve(problem, starts=3)
    x, y = design(problem), -problem.rows(np.zeros(2))[:, 0]
    values = np.linalg.lstsq(x, y)[0]
    errors = np.sqrt(np.diag(np.linalg.inv(x.T @ x)) * np.sum((x @ values - y) ** 2) / 38)
    assert fit.spread.kind == "model"
    assert fit.vector == pytest.approx(values, rel=1e-7)
    assert list(fit.errors.values()) == pytest.approx(errors, rel=1e-5)
    for name, value, error in zip(problem.names, values, errors, strict=True):
        reach = stats.t.ppf(0.975, 38) * error
        assert fit.interval(name) == pytest.approx((value - reach, value + reach, False, False), rel=1e-5)


def test_the_sandwich_is_the_one_of_white() -> None:
    """Oracle: (X'X)^-1 X' diag(r^2) X (X'X)^-1, with the factor n/(n - p)."""
    problem = line(2, loss="linear")
    fit = solve(problem, starts=1)
    x, bread = design(problem), np.linalg.inv(design(problem).T @ design(problem))
    white = bread @ (x.T * problem.rows(fit.vector)[:, 0] ** 2) @ x @ bread * 40 / 38
    assert fit.spread.kind == "sandwich"
    assert fit.covariance.to_numpy() == pytest.approx(white, rel=1e-5)


def test_a_row_counts_as_a_whole() -> None:
    """Oracle: the formula of the loss; a rotation of the components of a row changes nothing."""
    rows = np.random.default_rng(3).normal(size=(7, 2))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    costs = [Problem(LINE, lambda _, r=r: r, loss_scale=0.5).cost(np.zeros(2)) for r in (rows, rows @ turn)]
    plain = np.sum(0.25 * (np.sqrt(1.0 + np.sum(rows**2, axis=1) / 0.25) - 1.0))
    assert costs == pytest.approx([plain, plain], rel=1e-12)


def test_the_gradient_and_the_hessian_are_those_of_the_cost() -> None:
    """Oracle: differences of the cost, in a problem whose residuals are linear."""
    problem = line(4, loss_scale=0.2)
    at, steps = np.array([1.0, 2.2]), 1e-3 * np.eye(2)
    cost = problem.cost
    gradient = [(cost(at + s) - cost(at - s)) / 2e-3 for s in steps]
    mixed = [
        [(cost(at + s + t) - cost(at + s - t) - cost(at - s + t) + cost(at - s - t)) / 4e-6 for s in steps]
        for t in steps
    ]
    scores, hessian = problem.scores(at)
    assert scores.sum(axis=0) == pytest.approx(gradient, rel=1e-4)
    assert hessian == pytest.approx(np.array(mixed), rel=1e-3)


def test_outliers_hardly_move_a_robust_fit() -> None:
    exact = line(5, noise=0.02)
    shift = np.where(np.arange(40) < 4, -5.0, 0.0)
    problem = replace(exact, residuals=lambda values: exact.residuals(values) + shift, loss_scale=0.05)
    assert solve(problem, starts=2).vector == pytest.approx([1.5, 2.0], abs=0.03)
    assert abs(solve(replace(problem, loss="linear"), starts=2).values["height"] - 2.0) > 0.3


def test_a_second_minimum_is_left_from_several_starts_or_on_the_way_along_a_profile() -> None:
    """Oracle: (x^2 - 1)^2 + 0.04 (x - 1)^2 is least at 1; x (x + 1) = -0.02 beside -1 is a local minimum."""
    problem = Problem(
        (Parameter("x", "", -2.0, 1.1, 1.0),),
        lambda v: np.array([v[0] ** 2 - 1.0, 0.2 * (v[0] - 1.0), 1.0, -1.0]),
        clusters=np.zeros(4),
        loss="linear",
    )
    fit, alone = (solve(problem, {"x": -1.5}, starts=starts) for starts in (12, 1))
    assert fit.values["x"] == pytest.approx(1.0, abs=1e-6)
    assert len(fit.starts) == fit.starts["converged"].sum() == 12
    assert alone.values["x"] == pytest.approx(-0.5 - np.sqrt(0.25 - 0.02), abs=1e-5)
    with pytest.raises(LocalMinimumError, match="below"):
        alone.interval("x")
    again, intervals = profiled(alone)
    assert again.values == pytest.approx(fit.values)
    assert len(again.starts) == 2
    assert intervals["x"] == pytest.approx(fit.interval("x"))


def test_a_parameter_on_its_bound_is_exactly_there_and_has_a_one_sided_interval() -> None:
    fit = solve(line(6, slope=-0.02, noise=0.5, parameters=(LINE[0]._replace(low=0.0), LINE[1])), starts=4)
    assert fit.on_bound == {"slope": 0.0}
    assert np.isnan(fit.errors["slope"])
    low, high, *on_bound = fit.interval("slope")
    assert low == 0.0 < high < 1.0
    assert on_bound == [True, False]
    assert fit.errors["height"] == pytest.approx(0.5 / np.sqrt(40), rel=0.4)


def test_the_data_may_say_nothing_or_all_of_a_parameter() -> None:
    """An idle parameter has its bounds as interval; exact data leave hardly any."""
    idle = solve(line(7, parameters=(*LINE, Parameter("idle", "", 0.0, 1.0, 1.0))), starts=3)
    assert idle.interval("idle") == (0.0, 1.0, True, True)
    assert idle.interval("slope").high < 2.0
    exact = solve(line(8, noise=0.0), starts=2)
    assert exact.interval("slope")[:2] == pytest.approx((1.5, 1.5), abs=1e-6)


def test_a_fixed_parameter_stays() -> None:
    fit = solve(line(9, fixed={"height": 2.0}), starts=2)
    assert list(fit.errors) == ["slope"]
    assert fit.values == {"height": 2.0, "slope": pytest.approx(1.5, abs=0.1)}
    cost, values = fit.held(slope=1.0)
    assert values == {"slope": 1.0, "height": 2.0}
    assert cost == pytest.approx(fit.problem.cost(np.array([1.0, 2.0])))


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
def test_a_wrong_problem_is_named(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solve(replace(line(12), **change), starts=1)
