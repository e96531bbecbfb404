"""identify of rebounds: known truths come back, with intervals that cover; symmetry; the words for wrong tables."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv import Body, ContactLaw
from sledenv.command.cli import main
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebound_fit import Identification
from sledenv.identification.rebounds import AFTER, BEFORE
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


def table(seed: int = 0, n: int = 200, noise: float = 0.02, **truth) -> pd.DataFrame:
    rng = np.random.default_rng(seed)
    return rebounding(told_by_arms(rng, n), rng, noise, **truth)


def identified(given: pd.DataFrame | Path, **options) -> Identification:
    return sledenv.identify(given, gyration_radius=GYRATION, **{"starts": 4} | options)


def holds(found: Identification, name: str, value: float) -> bool:
    return found.intervals[name].low <= value <= found.intervals[name].high


# --- recovery --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hypothesis", ["energetic", "poisson", "newton"])
def test_exact_rebounds_give_the_law_back(hypothesis: str) -> None:
    found = identified(table(1, 60, 0.0, hypothesis=hypothesis), hypothesis=hypothesis)
    assert {name: found.values[name] for name in TRUTH} == pytest.approx(TRUTH, rel=1e-5)
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


@pytest.mark.parametrize(
    ("name", "value"), [("restitution", 0.0), ("restitution", 1.0), ("friction", 0.0), ("rolling_arm", 0.0)]
)
def test_a_truth_on_its_bound_is_in_a_one_sided_interval(name: str, value: float) -> None:
    found = identified(table(4, 150, 0.03, **{name: value}))
    assert holds(found, name, value)
    assert found.intervals[name].high_on_bound if value == 1.0 else found.intervals[name].low_on_bound
    for other in set(TRUTH) - {name}:
        assert found.values[other] == pytest.approx(TRUTH[other], abs=5 * found.fit.errors[other])


def test_speed_dependent_restitution_is_found() -> None:
    """At the median approach speed, v_m, restitution is that of the truth there: 0.6 (v_m/2)^-0.25."""
    found = identified(table(5, 300, 0.01, softening=0.25), speed_dependent=True)
    assert found.values["softening"] == pytest.approx(0.25, abs=0.03)
    speed = found.model.reference_speed
    assert speed == np.median(found.rebounds.approach)
    assert found.values["restitution"] == pytest.approx(0.6 * (speed / 2.0) ** -0.25, abs=0.01)


def test_a_mirrored_table_gives_the_same_law() -> None:
    given = table(7)
    mirrored = given.copy()
    mirrored[["a_m", "u_before_m_s", "omega_before_rad_s", "u_after_m_s", "omega_after_rad_s"]] *= -1.0
    one, other = identified(given), identified(mirrored)
    assert one.values == pytest.approx(other.values, rel=1e-6)
    assert one.intervals["friction"] == pytest.approx(other.intervals["friction"], rel=1e-5)


def test_fixed_parameters_bounds_and_start() -> None:
    found = identified(table(8), fixed={"rolling_arm": 0.0006, "friction": 0.15})
    assert found.fit.problem.free == ["restitution"]
    assert found.values["friction"] == 0.15
    bound = identified(table(8), bounds={"friction": (0.2, 0.5)}, start={"friction": 0.3})
    assert bound.values["friction"] == bound.fit.on_bound["friction"] == 0.2
    assert any("friction is on its bound, 0.2" in text for text in bound.warnings)


@pytest.mark.slow
def test_intervals_cover_200_truths_at_their_level() -> None:
    """0.95 +- 3 of its standard errors; a rolling arm on its bound is covered more often than that."""
    rng = np.random.default_rng(11)
    inside = dict.fromkeys(TRUTH, 0)
    for _ in range(200):
        truth = {
            "restitution": rng.uniform(0.2, 0.95),
            "friction": rng.uniform(0.03, 0.3),
            "rolling_arm": rng.choice([0.0, rng.uniform(0.0, 0.002)]),
        }
        given = rebounding(told_by_arms(rng, 60), rng, rng.uniform(0.01, 0.05), **truth)
        found = identified(given, starts=2)
        for name, value in truth.items():
            inside[name] += holds(found, name, value)
    assert 180 <= inside["restitution"] <= 199
    assert 180 <= inside["friction"] <= 199
    assert inside["rolling_arm"] >= 180


# --- doubts ----------------------------------------------------------------------------------------------------------


def test_rebounds_that_no_law_explains_are_counted() -> None:
    given = table(14)
    given.loc[3, "v_after_m_s"] = -1.0
    given.loc[5, "v_after_m_s"] = 9.0
    texts = identified(given).warnings
    assert "1 rebounds still approach afterwards, the first of them in row 3" in texts
    assert "1 rebounds have more energy after than before, the first of them in row 5" in texts


def test_one_rebound_is_enough_for_one_parameter_and_refused_for_three() -> None:
    """Any law that gives its three velocities would fit, so that no interval means anything."""
    found = identified(table(15, 1, 0.0), fixed={"friction": 0.15, "rolling_arm": 0.0006})
    assert found.values["restitution"] == pytest.approx(0.6, rel=1e-6)
    assert found.fit.spread.kind == "model"
    with pytest.raises(ValueError, match=r"1 rebounds: .* 3 parameters that are fitted \(restitution, friction, roll"):
        identified(table(15, 1, 0.0))


FEW = "2 recordings do not show how errors vary between them: intervals suppose equal and independent errors of all 6 "


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (table(15, 2, 0.01), f"{FEW}velocities; record 10 or more, or fix parameters"),
        (table(15, 9, 0.01), "9 recordings leave 6 degrees of freedom: intervals may be too short; record 10"),
        (table(15, 10, 0.01), ""),
        (table(15, 40, 0.01).assign(recording=np.repeat(["one", "two"], 20)), "2 recordings do not show how errors"),
    ],
    ids=["2", "9", "10", "40 rows of 2"],
)
def test_intervals_of_few_recordings_come_with_a_warning(given: pd.DataFrame, words: str) -> None:
    texts = [text for text in identified(given).warnings if "recordings" in text]
    assert any(words in text for text in texts) if words else not texts


# --- speeds alone ----------------------------------------------------------------------------------------------------


def test_normal_speeds_alone_tell_the_restitution(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the truth; linear least squares with the errors that vary between rebounds (White)."""
    rng = np.random.default_rng(3)
    before = -rng.uniform(1.0, 3.0, 40)
    given = pd.DataFrame({"v_before_m_s": before, "v_after_m_s": -0.7 * before + 0.02 * rng.normal(size=40)})
    found = sledenv.identify(given, loss="linear")
    share = given["v_after_m_s"] / -given["v_before_m_s"]
    assert found.values["restitution"] == pytest.approx(share.mean(), rel=1e-6)
    assert found.fit.errors["restitution"] == pytest.approx(share.std(ddof=1) / math.sqrt(40), rel=1e-3)
    assert found.table.loc["friction", "note"] == "not fitted"
    assert any("nothing of friction" in text for text in found.warnings)
    assert sledenv.identify(given, DISC).values["restitution"] == pytest.approx(0.7, abs=0.01)
    given.to_csv(tmp_path / "speeds.csv", index=False)
    assert main(["identify", str(tmp_path / "speeds.csv")]) == 0
    assert "restitution" in capsys.readouterr().out
    with pytest.raises(ValueError, match="spins must be given"):
        sledenv.identify(given, ECCENTRIC)
    with pytest.raises(ValueError, match="one of them must be given"):
        sledenv.identify(given.assign(omega_before_rad_s=0.0))


# --- laws that are none ----------------------------------------------------------------------------------------------


def gripping(back: float, noise: float) -> pd.DataFrame:
    """Forty impacts of a ball that ends each slip and gives a share of it back."""
    rng = np.random.default_rng(40)
    b, k = 0.1, 0.1 * math.sqrt(0.4)
    u, v, omega = rng.uniform(-2.0, 2.0, 40), -rng.uniform(1.0, 3.0, 40), rng.uniform(-10.0, 10.0, 40)
    impulse = -(1.0 + back) * (u + b * omega) / (1.0 + (b / k) ** 2)
    after = np.stack([u + impulse, -0.7 * v, omega + b * impulse / k**2])
    after += noise * rng.normal(size=(3, 40)) / [[1.0], [1.0], [k]]
    rows = zip((*BEFORE, *AFTER), (u, v, omega, *after), strict=True)
    return pd.DataFrame({"a_m": 0.0, "b_m": b, **dict(rows)})


@pytest.mark.parametrize(("back", "noise"), [(0.15, 1e-6), (0.15, 0.03), (0.6, 0.03)])
def test_slip_that_is_reversed_is_refused_without_a_fit(back: float, noise: float) -> None:
    with pytest.raises(ValueError, match=r"is reversed in \d+ of 40 rebounds, the first of them in row \d"):
        sledenv.identify(gripping(back, noise), gyration_radius=0.1 * math.sqrt(0.4))


# --- tables and arguments --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_files_are_read_as_the_table_is(tmp_path: Path, suffix: str) -> None:
    """Spaces after commas are no part of names and values."""
    given, file = table(16, 30), tmp_path / f"rebounds{suffix}"
    if suffix == ".csv":
        file.write_text(given.to_csv(index=False).replace(",", " , "))
    else:
        given.to_parquet(file)
    read, told = (read_rebounds(one, gyration_radius=GYRATION) for one in (file, given))
    # Before version 3 pandas reads the last digit of a decimal number wrongly.
    assert read.contacts == pytest.approx(told.contacts, rel=1e-14)
    assert read.after == pytest.approx(told.after, rel=1e-14)


def put(column: str, value: object) -> pd.DataFrame:
    """A table with a wrong value in its third row."""
    given = table(17, 10)
    if isinstance(value, str):
        given[column] = given[column].astype(object)
    given.loc[2, column] = value
    return given


SOUND = table(17, 10)
BY_ARMS = {"gyration_radius": GYRATION}


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        (SOUND.drop(columns="u_after_m_s"), BY_ARMS, "u_after_m_s: there is no such column; the table has 'a_m'"),
        (SOUND.rename(columns={"b_m": "b"}), BY_ARMS, "b_m: there is no such column, but b: a column is named w"),
        (SOUND.rename(columns={"omega_before_rad_s": "omega_before_deg_s"}), BY_ARMS, "but omega_before_deg_s"),
        (put("v_before_m_s", np.nan), BY_ARMS, "v_before_m_s, row 2: is nan, must be a finite number"),
        (put("omega_after_rad_s", np.inf), BY_ARMS, "omega_after_rad_s, row 2: is inf"),
        (put("u_after_m_s", "1,5"), BY_ARMS, "u_after_m_s, row 2: is '1,5', must be a number, with a dec"),
        (SOUND.assign(u_after_m_s=True), BY_ARMS, "u_after_m_s: must be numbers, is of the type bool"),
        (put("v_before_m_s", 1.5), BY_ARMS, "row 2: the gap opens at"),
        (SOUND.iloc[:0], BY_ARMS, "the table has no rows"),
        (SOUND.assign(recording=[None, *range(9)]), BY_ARMS, "recording, row 0: there is no value"),
        (SOUND.assign(recording=[{"name": 1}] * 10), BY_ARMS, "recording, row 0: is {'name': 1}, must be a text or"),
        # With such numbers squares overflow, and a cast would drop the imaginary part.
        (put("u_before_m_s", 1e300), BY_ARMS, r"u_before_m_s, row 2: is 1e\+300, must be in \[-1e\+09, 1e\+09\]"),
        (SOUND.assign(a_m=1 + 2j), BY_ARMS, "a_m: must be numbers, is of the type complex128"),
        (pd.DataFrame(0, range(2), [f"c{i}" for i in range(5000)]), BY_ARMS, "'c0', .*, 'c11' and 4988 more"),
        (pd.concat([SOUND, SOUND["a_m"]], axis=1), BY_ARMS, "a_m: there are 2 columns of this name"),
        (SOUND, {}, "one of them must be given"),
        (SOUND, {"body": DISC, "gyration_radius": 0.1}, "one of them must be given"),
        (SOUND, {"body": DISC}, "phi_rad: there is no such column"),
        (SOUND, {"gyration_radius": 0.0}, r"identify\.gyration_radius = 0\.0: must be in \[1e-09, 1e\+09\] m"),
        (SOUND, {"gyration_radius": 10**400}, r"identify\.gyration_radius = 1.*: must be in \[1e-09, 1e\+09\] m"),
        (SOUND, BY_ARMS | {"fixed": {"mass": 1.0}}, "'mass' is no parameter"),
        (SOUND, BY_ARMS | {"bounds": {"mass": (0.0, 1.0)}}, "'mass' is no parameter"),
        (SOUND, BY_ARMS | {"hypothesis": "hertz"}, "hypothesis = 'hertz'"),
    ],
)
def test_a_bad_table_or_argument_is_refused_by_name(given: pd.DataFrame, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sledenv.identify(given, **options)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.mat", "", r"must end in \.csv or \.parquet"),
        ("a.csv", "", "is no table"),
        ("a.parquet", "", "is no table"),
        ("a.csv", "# filmed\nv_before_m_s\n", "'# filmed': must name the columns"),
        ("a.csv", "\xf6\n", "in UTF-8, but byte 1"),
        ("a.csv", 'v_before_m_s,v_after_m_s\n-1,"0.5\n-2,1\n-3,"1.5\n', "line 2 = '-1,\"0.5': a quotation mark has no"),
        ("a.csv", "v_before_m_s,v_before_m_s,v_after_m_s\n-1,-1,1\n", "v_before_m_s: there are 2 columns of this name"),
        ("a.csv", f"{'c,' * 100_000}c\n", "its first line has more than 100000 characters"),
        # As spreadsheets write them where the comma is the decimal sign.
        ("a.csv", table(21, 9).to_csv(index=False, sep=";", decimal=","), "semicolons separate .* a decimal point"),
        ("a.csv", table(21, 9).to_csv(index=False, sep="\t", decimal=","), "tabs separate its columns"),
        ("a.csv", table(21, 9).to_csv(index=False, decimal=","), "is '[-0-9]+,[0-9]+', must be a number, with a dec"),
    ],
)
def test_a_file_that_is_no_table_is_refused_in_few_words(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=message) as refused:
        identified(tmp_path / name)
    assert len(str(refused.value)) < 400
    with pytest.raises(OSError, match="cannot be read: No such file"):
        identified(tmp_path / "none.csv")


# --- the command -----------------------------------------------------------------------------------------------------


def test_the_command_prints_the_fit_and_writes_a_folder(tmp_path: Path, capsys) -> None:
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
    residuals = rows[["u_residual", "v_residual", "omega_residual"]]
    assert len(rows) == 80
    assert rows["error"].to_numpy() == pytest.approx(np.linalg.norm(residuals, axis=1))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--gyration-radius", "-1"], "--gyration-radius. Must be >= 1e-09"),
        (["--gyration-radius", "0.02", "--fix", "friction"], "must be NAME=VALUE: 'friction'"),
        (["--gyration-radius", "0.02", "--fix", "friction=9"], r"fixed.friction = 9.0: must be in \[0, 2\]"),
        (["--gyration-radius", "0.02", "--radius", "0.1"], "phi_rad: there is no such column"),
    ],
)
def test_a_wrong_command_writes_nothing(tmp_path: Path, capsys, arguments: list[str], message: str) -> None:
    file, out = tmp_path / "rebounds.csv", tmp_path / "fit"
    table(22, 10).to_csv(file, index=False)
    try:
        status = main(["identify", str(file), *arguments, "--out", str(out)])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert re.search(message, capsys.readouterr().err)
    assert not out.exists()
