"""identify of rebounds: known truths come back, with intervals that cover; symmetry; what a wrong table is told."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv import Body, ContactLaw
from sledenv.command.cli import main
from sledenv.identification.fitting import profiled
from sledenv.identification.plausibility import check_slips, read_rebounds
from sledenv.identification.rebound_fit import Identification, ImpactModel
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE
from tests.identification.rebound_tables import (
    DISC,
    ECCENTRIC,
    GYRATION,
    SEGMENT,
    SKATE,
    TRUTH,
    of_body,
    rebounding,
    told_by_arms,
)

FITTED = list(TRUTH)


def table(seed: int = 0, n: int = 200, noise: float = 0.02, **truth) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return rebounding(told_by_arms(rng, n), rng, noise, **truth)


def identified(given: pd.DataFrame, **options) -> Identification:
    return sledenv.identify(given, gyration_radius=GYRATION, **{"starts": 4} | options)


# --- recovery --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hypothesis", ["energetic", "poisson", "newton"])
def test_exact_rebounds_give_the_law_back(hypothesis: str) -> None:
    found = identified(table(1, 60, 0.0, hypothesis=hypothesis), hypothesis=hypothesis)
    assert {name: found.values[name] for name in FITTED} == pytest.approx(TRUTH, rel=1e-5)
    assert found.errors.max() < 1e-6


@pytest.mark.parametrize(
    "body", [DISC, ECCENTRIC, SEGMENT, SKATE], ids=["disc", "eccentric disc", "segment", "hull of circles"]
)
def test_bodies_told_by_their_pose(body: Body) -> None:
    """The segment and the hull land on their corners as well, which have an arm of their own."""
    law = ContactLaw(1e6, 0.0, 0.12, 0.004, 0.002)
    found = sledenv.identify(of_body(body, law, 0.55, np.random.default_rng(2), 80), body, starts=6)
    corner = 0.002 if body in (SEGMENT, SKATE) else 0.0
    assert found.values == pytest.approx(
        {"restitution": 0.55, "friction": 0.12, "rolling_arm": 0.004, "corner_rolling_arm": corner, "softening": 0.0},
        rel=1e-4,
        abs=1e-7,
    )
    assert found.rebounds.corner.any() == (body in (SEGMENT, SKATE))
    assert found.warnings == []


def test_a_body_that_lands_on_corners_only_has_no_arm_of_its_arc() -> None:
    given = of_body(SEGMENT, ContactLaw(1e6, 0.0, 0.2, 0.004, 0.003), 0.5, np.random.default_rng(3), 60)
    turned = np.abs(np.remainder(given["phi_rad"] + math.pi, 2 * math.pi) - math.pi)
    found = sledenv.identify(given[turned > SEGMENT.half_angle].reset_index(drop=True), SEGMENT, starts=4)
    assert found.fit.problem.fixed["rolling_arm"] == 0.0
    assert found.values["corner_rolling_arm"] == pytest.approx(0.003, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "value"), [("restitution", 0.0), ("restitution", 1.0), ("friction", 0.0), ("rolling_arm", 0.0)]
)
def test_a_truth_on_its_bound_is_in_a_one_sided_interval(name: str, value: float) -> None:
    found = identified(table(4, 150, 0.03, **{name: value}))
    low, high, _, low_on_bound, high_on_bound = found.intervals[name]
    assert low <= value <= high
    assert high_on_bound if value == 1.0 else low_on_bound
    others = [other for other in FITTED if other != name]
    for other in others:
        assert found.values[other] == pytest.approx(TRUTH[other], abs=5 * found.fit.errors[other])


def test_speed_dependent_restitution_is_found() -> None:
    """At the median approach speed, v_m, restitution is that of the truth there: .6 (v_m/2)^-.25."""
    given = table(5, 300, 0.01, softening=0.25)
    found = identified(given, speed_dependent=True)
    assert found.values["softening"] == pytest.approx(0.25, abs=0.03)
    speed = found.model.reference_speed
    assert speed == np.median(found.rebounds.approach)
    assert found.values["restitution"] == pytest.approx(0.6 * (speed / 2.0) ** -0.25, abs=0.01)
    assert identified(table(5), speed_dependent=True).intervals["softening"].low < 0.0


def test_outliers_hardly_move_the_fit() -> None:
    given = table(6, 200, 0.02)
    given.loc[:9, "omega_after_rad_s"] *= -1.0
    given.loc[:9, "v_after_m_s"] += 2.0
    found = identified(given)
    assert found.values["restitution"] == pytest.approx(0.6, abs=0.02)
    assert identified(given, loss="linear").values["restitution"] > 0.62


def test_a_mirrored_table_gives_the_same_law() -> None:
    given = table(7)
    mirrored = given.copy()
    mirrored[["a_m", "u_before_m_s", "omega_before_rad_s", "u_after_m_s", "omega_after_rad_s"]] *= -1.0
    one, other = identified(given), identified(mirrored)
    assert one.values == pytest.approx(other.values, rel=1e-6)
    assert one.intervals["friction"][:2] == pytest.approx(other.intervals["friction"][:2], rel=1e-5)


def test_fixed_parameters_bounds_and_start() -> None:
    given = table(8)
    found = identified(given, fixed={"rolling_arm": 0.0006, "friction": 0.15})
    assert found.fit.problem.free == ["restitution"]
    assert found.values["friction"] == 0.15
    bound = identified(given, bounds={"friction": (0.2, 0.5)}, start={"friction": 0.3})
    assert bound.values["friction"] == 0.2
    assert bound.fit.on_bound["friction"] == 0.2
    assert any("friction is on its bound, 0.2" in text for text in bound.warnings)


def test_rows_of_one_recording_are_not_counted_as_many() -> None:
    """Each row ten times over, as one recording: the intervals are those of the rows by themselves."""
    given = table(9, 60, 0.03)
    tenfold = pd.concat([given.assign(recording=[f"film {k}" for k in range(60)])] * 10, ignore_index=True)
    alone, many = identified(given), identified(tenfold)
    assert many.fit.errors["friction"] == pytest.approx(alone.fit.errors["friction"], rel=0.02)
    assert many.intervals["friction"].high == pytest.approx(alone.intervals["friction"].high, rel=0.02)


def coverage(truths: int, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    inside = dict.fromkeys(FITTED, 0)
    for _ in range(truths):
        truth = {
            "restitution": rng.uniform(0.2, 0.95),
            "friction": rng.uniform(0.03, 0.3),
            "rolling_arm": rng.choice([0.0, rng.uniform(0.0, 0.002)]),
        }
        given = rebounding(told_by_arms(rng, 60), rng, rng.uniform(0.01, 0.05), **truth)
        found = identified(given, starts=2)
        for name, value in truth.items():
            inside[name] += found.intervals[name].low <= value <= found.intervals[name].high
    return {name: count / truths for name, count in inside.items()}


@pytest.mark.slow
def test_intervals_cover_200_truths_at_their_level() -> None:
    """.95 +- 3 of its standard errors; a rolling arm on its bound is covered more often than that."""
    found = coverage(200, 11)
    assert 0.90 <= found["restitution"] <= 0.995
    assert 0.90 <= found["friction"] <= 0.995
    assert found["rolling_arm"] >= 0.90


# --- doubts ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "arm"), [({"b_m": -1.0}, "b"), ({"a_m": -1.0}, "a"), ({"b_m": 1000.0}, "b")], ids=["b", "a", "mm"]
)
def test_an_arm_told_wrongly_is_noticed(change: dict[str, float], arm: str) -> None:
    given = table(13)
    for name, factor in change.items():
        given[name] *= factor
    given = given[given["a_m"] * given["omega_before_rad_s"] - given["v_before_m_s"] > 0.0].reset_index(drop=True)
    found = identified(given, starts=1, fixed={"friction": 0.1, "rolling_arm": 0.0})
    assert any(f"at the arm {arm}" in text for text in found.warnings)


def test_rebounds_that_no_law_explains_are_counted() -> None:
    given = table(14)
    given.loc[3, "v_after_m_s"] = -1.0
    given.loc[5, "v_after_m_s"] = 9.0
    texts = identified(given).warnings
    assert "1 rebounds still approach afterwards, the first of them in row 3" in texts
    assert "1 rebounds have more energy after than before, the first of them in row 5" in texts


def test_a_disc_that_only_slips_one_way_says_nothing_of_its_spin() -> None:
    """Without spin before and after, and without friction, rolling resistance has nothing to act on."""
    given = pd.DataFrame(0.0, range(6), ["phi_rad", *BEFORE, *AFTER])
    given["v_before_m_s"], given["v_after_m_s"], given["u_before_m_s"], given["u_after_m_s"] = -2.0, 1.0, 1.0, 1.0
    found = sledenv.identify(given, DISC, starts=2, fixed={"friction": 0.0})
    assert found.values["restitution"] == pytest.approx(0.5)
    assert "these rebounds say nothing of rolling_arm: every value in its bounds is as good" in found.warnings


def test_one_rebound_is_enough_for_one_parameter_and_refused_for_three() -> None:
    """Any law that gives its three velocities would fit, so that no interval means anything."""
    found = identified(table(15, 1, 0.0), fixed={"friction": 0.15, "rolling_arm": 0.0006})
    assert found.values["restitution"] == pytest.approx(0.6, rel=1e-6)
    assert found.fit.covariance_kind == "model"
    with pytest.raises(ValueError, match=r"1 rebounds: .* 3 parameters that are fitted \(restitution, friction, roll"):
        identified(table(15, 1, 0.0))


FEW = "2 recordings do not show how errors vary between them: intervals suppose equal and independent errors of all 6 "
ROWS_OF_FEW = table(15, 40, 0.01).assign(recording=np.repeat(["one", "two"], 20))


@pytest.mark.parametrize(
    ("given", "fixed", "words"),
    [
        (table(15, 2, 0.01), {}, f"{FEW}velocities; record 10 or more, or fix parameters"),
        (table(15, 9, 0.01), {}, "9 recordings leave 6 degrees of freedom: intervals may be too short; record 10"),
        (table(15, 10, 0.01), {}, ""),
        (table(15, 8, 0.01), {"friction": 0.15, "rolling_arm": 0.0006}, ""),
        (ROWS_OF_FEW, {}, "2 recordings do not show how errors vary between them"),
    ],
    ids=["2", "9", "10", "8 of one parameter", "40 rows of 2"],
)
def test_intervals_of_few_recordings_come_with_a_warning(
    given: pd.DataFrame, fixed: dict[str, float], words: str
) -> None:
    texts = [text for text in identified(given, fixed=fixed).warnings if "recordings" in text]
    assert any(words in text for text in texts) if words else not texts


# --- tables ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_files_are_read_as_the_table_is(tmp_path, suffix: str) -> None:
    given, file = table(16, 30), tmp_path / f"rebounds{suffix}"
    given.to_csv(file, index=False) if suffix == ".csv" else given.to_parquet(file)
    read, told = (read_rebounds(one, gyration_radius=GYRATION) for one in (file, given))
    # Before version 3 pandas reads the last digit of a decimal number wrongly.
    assert read.contacts == pytest.approx(told.contacts, rel=1e-14)
    assert read.after == pytest.approx(told.after, rel=1e-14)


def spoilt(column: str | None = None, row: int = 2, value: object = None, drop: str = "") -> pd.DataFrame:
    given = table(17, 10).drop(columns=drop or [])
    if column:
        given[column] = given[column].astype(object) if isinstance(value, str) else given[column]
        given.loc[row, column] = value
    return given


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (spoilt(drop="u_after_m_s"), "u_after_m_s: there is no such column; the table has 'a_m'"),
        (spoilt().rename(columns={"b_m": "b"}), "b_m: there is no such column, but b: a column is named w"),
        (spoilt().rename(columns={"omega_before_rad_s": "omega_before_deg_s"}), "but omega_before_deg_s"),
        (spoilt("v_before_m_s", value=np.nan), "v_before_m_s, row 2: is nan, must be a finite number"),
        (spoilt("omega_after_rad_s", value=np.inf), "omega_after_rad_s, row 2: is inf"),
        (spoilt("u_after_m_s", value="1,5"), "u_after_m_s, row 2: is '1,5', must be a number, with a dec"),
        (spoilt().assign(u_after_m_s=True), "u_after_m_s: must be numbers, is of the type bool"),
        (spoilt("v_before_m_s", value=1.5), "row 2: the gap opens at"),
        (spoilt().iloc[:0], "the table has no rows"),
        (spoilt().assign(recording=[None, *range(9)]), "recording, row 0: there is no value"),
        # With such numbers squares overflow, and a cast would drop the imaginary part.
        (spoilt("u_before_m_s", value=1e300), r"u_before_m_s, row 2: is 1e\+300, must be in \[-1e\+09, 1e\+09\]"),
        (spoilt("a_m", value=-1e10), r"a_m, row 2: is -1e\+10, must be in \[-1e\+09, 1e\+09\]"),
        (spoilt().assign(a_m=1 + 2j), "a_m: must be numbers, is of the type complex128"),
        (spoilt().assign(recording=[{"name": 1}] * 10), "recording, row 0: is {'name': 1}, must be a text or"),
    ],
)
def test_a_bad_table_is_refused_by_column_and_row(given: pd.DataFrame, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        identified(given)


def test_columns_that_are_there_twice_and_spaces_after_commas(tmp_path: Path) -> None:
    """Oracle: the table without either."""
    given, file = table(17, 20), tmp_path / "rebounds.csv"
    twice = pd.concat([given, given["v_before_m_s"]], axis=1)
    twice.to_csv(file, index=False)
    names = pd.DataFrame(0, given.index, ["recording", "recording"])
    for wrong in (twice, file, pd.concat([given, names], axis=1)):
        with pytest.raises(ValueError, match=r"(v_before_m_s|recording): there are 2 columns of this name"):
            identified(wrong)
    file.write_text(given.assign(recording="one").to_csv(index=False).replace(",", " , "))
    assert identified(file).values == pytest.approx(identified(given.assign(recording=0)).values, rel=1e-7)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (5_000, r"the table has 'c0', 'c1', 'c2', .*, 'c11' and 4988 more"),
        (1_000_000, "its first line has more than 100000 characters"),
    ],
)
def test_many_wrong_columns_are_refused_in_few_words(tmp_path: Path, columns: int, message: str) -> None:
    file = tmp_path / "wide.csv"
    file.write_text(f"{','.join(f'c{i}' for i in range(columns))}\n{'1,' * (columns - 1)}1\n")
    with pytest.raises(ValueError, match=message) as refused:
        identified(file)
    assert len(str(refused.value)) < 300


# --- speeds alone ----------------------------------------------------------------------------------------------------


def bounces(noise: float) -> pd.DataFrame:
    rng = np.random.default_rng(3)
    before = -rng.uniform(1.0, 3.0, 40)
    return pd.DataFrame({"v_before_m_s": before, "v_after_m_s": -0.7 * before + noise * rng.normal(size=40)})


def test_normal_speeds_alone_tell_the_restitution(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the truth; linear least squares with the errors that vary between rebounds (White)."""
    given = bounces(0.02)
    found = sledenv.identify(given, fixed={"softening": 0.0}, loss="linear")
    share = given["v_after_m_s"] / -given["v_before_m_s"]
    assert found.values["restitution"] == pytest.approx(share.mean(), rel=1e-6)
    assert found.fit.errors["restitution"] == pytest.approx(share.std(ddof=1) / math.sqrt(40), rel=1e-3)
    assert found.table.loc["friction", "note"] == "not fitted"
    assert any("nothing of friction" in text for text in found.warnings)
    assert sledenv.identify(given, DISC).values["restitution"] == pytest.approx(0.7, abs=0.01)
    file = tmp_path / "speeds.csv"
    given.to_csv(file, index=False)
    assert main(["identify", str(file)]) == 0
    assert "restitution" in capsys.readouterr().out
    with pytest.raises(ValueError, match="spins must be given"):
        sledenv.identify(given, ECCENTRIC)
    with pytest.raises(ValueError, match="one of them must be given"):
        sledenv.identify(given.assign(omega_before_rad_s=0.0))


def test_times_of_touchdown_alone_tell_the_restitution() -> None:
    """Oracle: flights that last in a geometric series; each recording by itself."""
    times = np.cumsum(0.8 ** np.arange(9.0))
    given = pd.DataFrame({"t_touchdown_s": [*times, *(7.0 + 0.5 * times)], "recording": np.repeat(["a", "b"], 9)})
    found = sledenv.identify(given)
    assert len(found.rebounds) == 14
    assert found.values["restitution"] == pytest.approx(0.8, abs=1e-9)
    with pytest.raises(ValueError, match="t_touchdown_s, row 9: is 0, must increase within a recording"):
        sledenv.identify(given.assign(t_touchdown_s=[*times, *(times - times[0])], recording="a"))
    with pytest.raises(ValueError, match="t_touchdown_s: must have 3 rows or more"):
        sledenv.identify(given.iloc[:2])


# --- laws that are none ----------------------------------------------------------------------------------------------


def gripping(n: int, back: float, noise: float, seed: int = 40) -> pd.DataFrame:
    """Impacts of a ball that ends each slip and gives a share of it back."""
    rng = np.random.default_rng(seed)
    b, k = 0.1, 0.1 * math.sqrt(0.4)
    u, v, omega = rng.uniform(-2.0, 2.0, n), -rng.uniform(1.0, 3.0, n), rng.uniform(-10.0, 10.0, n)
    impulse = -(1.0 + back) * (u + b * omega) / (1.0 + (b / k) ** 2)
    after = np.stack([u + impulse, -0.7 * v, omega + b * impulse / k**2])
    after += noise * rng.normal(size=(3, n)) / [[1.0], [1.0], [k]]
    rows = zip((*BEFORE, *AFTER), (u, v, omega, *after), strict=True)
    return pd.DataFrame({"a_m": 0.0, "b_m": b, **dict(rows)})


@pytest.mark.parametrize(("back", "noise"), [(0.15, 1e-6), (0.15, 0.03), (0.6, 0.03)])
def test_slip_that_is_reversed_is_refused_without_a_fit(back: float, noise: float) -> None:
    with pytest.raises(ValueError, match=r"is reversed in \d+ of 40 rebounds, the first of them in row \d"):
        sledenv.identify(gripping(40, back, noise), gyration_radius=0.1 * math.sqrt(0.4))


@pytest.mark.parametrize("friction", [0.1, 0.9])
@pytest.mark.parametrize("arm", [0.0, 0.004, 0.05])
def test_slips_of_a_disc_by_a_law_are_let_be(friction: float, arm: float) -> None:
    """Oracle: rigid impacts; with the longest arm rolling resistance reverses slips of its own."""
    given = of_body(DISC, ContactLaw(1e6, 0.0, friction, arm), 0.55, np.random.default_rng(2), 60)
    rng = np.random.default_rng(3)
    for noise in (0.0, 0.03):
        after = given[list(AFTER)] + noise * rng.normal(size=(60, 3)) * [1.0, 1.0, 10.0]
        noisy = given.assign(**after)
        check_slips(read_rebounds(noisy, DISC))


def test_a_fit_ends_where_a_cost_falls_by_its_rounding() -> None:
    """Bounces that no law explains, nearly without noise, whose profile had no end."""
    rebounds = read_rebounds(gripping(40, 0.15, 1e-6), gyration_radius=0.1 * math.sqrt(0.4))
    fit, intervals = profiled(ImpactModel().fit(rebounds))
    assert len(fit.starts) < 30
    assert intervals["restitution"].low <= 0.7 + 1e-4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "one of them must be given"),
        ({"body": DISC, "gyration_radius": 0.1}, "one of them must be given"),
        ({"body": DISC}, "phi_rad: there is no such column"),
        ({"gyration_radius": 0.0}, r"identify\.gyration_radius = 0\.0: must be in"),
        *(
            ({"gyration_radius": radius}, r"identify\.gyration_radius = 1.*: must be in \[1e-09, 1e\+09\] m")
            for radius in (1e200, 1e-200, 10**400)  # which nothing has
        ),
        ({"gyration_radius": GYRATION, "fixed": {"mass": 1.0}}, "'mass' is no parameter"),
        ({"gyration_radius": GYRATION, "bounds": {"mass": (0.0, 1.0)}}, "'mass' is no parameter"),
        ({"gyration_radius": GYRATION, "hypothesis": "hertz"}, "hypothesis = 'hertz'"),
    ],
)
def test_wrong_arguments_are_refused_by_name(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sledenv.identify(table(18), **options)


def test_without_pandas_the_error_names_what_to_install(monkeypatch) -> None:
    for name in [name for name in sys.modules if name.startswith("sledenv.identification")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(vars(sledenv), "identify", raising=False)  # it stays once it has been loaded
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"sledenv\.identification: .*pandas.*pip install 'sledenv\[analysis\]'"):
        sledenv.identify("rebounds.csv", gyration_radius=0.5)
    with pytest.raises(AttributeError, match="no attribute 'identity'"):
        _ = sledenv.identity


def test_files_that_are_no_tables(tmp_path) -> None:
    with pytest.raises(ValueError, match=r"must end in \.csv or \.parquet"):
        identified(tmp_path / "rebounds.mat")
    with pytest.raises(OSError, match="cannot be read: No such file"):
        identified(tmp_path / "none.csv")
    for text, message in (
        ("# filmed\nv_before_m_s\n", "'# filmed': must name the columns"),
        ("\xf6\n", "in UTF-8, but byte 1"),
        (
            'v_before_m_s,v_after_m_s\n-1,"0.5\n-2,1\n-3,"1.5\n',
            "line 2 = '-1,\"0.5': a quotation mark has no other one",
        ),
    ):
        (tmp_path / "told.csv").write_text(text, encoding="latin-1")
        with pytest.raises(ValueError, match=message):
            identified(tmp_path / "told.csv")
    for name in ("empty.csv", "empty.parquet"):
        (tmp_path / name).write_text("")
        with pytest.raises(ValueError, match="is no table"):
            identified(tmp_path / name)


@pytest.mark.parametrize(
    ("separator", "message"),
    [(";", "semicolons separate its columns"), ("\t", "tabs separate"), (",", "is '[-0-9]+,[0-9]+', must be a number")],
)
def test_a_table_with_decimal_commas_is_refused_in_words(tmp_path, capsys, separator: str, message: str) -> None:
    """As spreadsheets write it where the comma is the decimal sign."""
    file = tmp_path / "rebounds.csv"
    table(21, 10).to_csv(file, index=False, sep=separator, decimal=",")
    assert main(["identify", str(file), "--gyration-radius", str(GYRATION)]) == 2
    error = capsys.readouterr().err
    assert re.search(message, error)
    assert "decimal point" in error


def test_other_impacts_are_predicted() -> None:
    """Oracle: the truth, from exact rebounds; velocities after are not needed."""
    found, other = identified(table(19, 60, 0.0)), table(20, 5, 0.0)
    assert found.predict(other[[*ARMS, *BEFORE]]) == pytest.approx(other[list(AFTER)].to_numpy(), abs=1e-4)


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_prints_the_fit_and_writes_a_folder(tmp_path, capsys) -> None:
    file, out = tmp_path / "rebounds.csv", tmp_path / "fit"
    table(21, 80).to_csv(file, index=False)
    assert main(["identify", str(file), "--gyration-radius", str(GYRATION), "--starts", "3", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "80 rebounds of 80 recordings, energetic restitution" in printed
    assert "rolling_arm" in printed
    names = ["balance.csv", "parameters.csv", "profiles.png", "rebounds.csv", "residuals.png", "starts.csv"]
    assert sorted(path.name for path in out.iterdir()) == names
    parameters = pd.read_csv(out / "parameters.csv", index_col="parameter")
    assert parameters.loc["restitution", "low"] < 0.6 < parameters.loc["restitution", "high"]
    rows = pd.read_csv(out / "rebounds.csv")
    assert len(rows) == 80
    assert rows["error"].to_numpy() == pytest.approx(
        np.linalg.norm(rows[["u_residual", "v_residual", "omega_residual"]], axis=1)
    )


def test_the_command_takes_a_body_and_fixed_values(tmp_path, capsys) -> None:
    file = tmp_path / "rebounds.parquet"
    of_body(SEGMENT, ContactLaw(1e6, 0.0, 0.2, 0.0), 0.5, np.random.default_rng(4), 20).to_parquet(file)
    k = math.sqrt(SEGMENT.inertia / SEGMENT.mass)
    shape = ["--radius", "0.2", "--eccentricity", repr(SEGMENT.eccentricity), "--half-angle-deg", "70"]
    fixed = ["--fix", "rolling_arm=0", "--fix", "corner_rolling_arm=0", "--starts", "2"]
    command = ["identify", str(file), "--gyration-radius", repr(k), *shape, *fixed]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "restitution                 0.5 " in printed
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    parameters = {row["parameter"]: row for row in found["parameters"]}
    assert parameters["restitution"]["value"] == pytest.approx(0.5, abs=1e-6)
    assert (parameters["rolling_arm"]["value"], parameters["rolling_arm"]["low"]) == (0.0, None)


@pytest.mark.parametrize("columns", [["phi_rad", *BEFORE, *AFTER], ["t_s", "x_m", "y_m", "phi_rad"]])
def test_an_orientation_without_a_radius_names_the_option(tmp_path, capsys, columns: list[str]) -> None:
    file = tmp_path / "recorded.csv"
    pd.DataFrame(0.5, range(10), columns).to_csv(file, index=False)
    assert main(["identify", str(file), "--gyration-radius", "0.1", "--slope-deg", "5"]) == 2
    error = capsys.readouterr().err
    assert "--radius: is missing, and phi_rad needs it" in error
    assert "of a disc or a segment; any other body goes by sledenv.identify(FILE, body" in error
    assert main(["identify", "--help"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "phi_rad is that of a disc or a segment" in told
    assert "sledenv.identify(FILE, body)" in told


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--gyration-radius", "-1"], r"must be a number in \[1e-09, 1e\+09\] m: '-1'"),
        (["--gyration-radius", "0.02", "--fix", "friction"], "must be NAME=VALUE: 'friction'"),
        (["--gyration-radius", "0.02", "--fix", "friction=9"], r"fixed.friction = 9.0: must be in \[0, 2\]"),
        (["--gyration-radius", "0.02", "--radius", "0.1"], "phi_rad: there is no such column"),
    ],
)
def test_a_wrong_command_writes_nothing(tmp_path, capsys, arguments: list[str], message: str) -> None:
    file, out = tmp_path / "rebounds.csv", tmp_path / "fit"
    table(22, 10).to_csv(file, index=False)
    try:
        status = main(["identify", str(file), *arguments, "--out", str(out)])
    except SystemExit as end:
        status = end.code
    assert status == 2
    error = capsys.readouterr().err
    assert re.search(message, error)
    assert not out.exists()
