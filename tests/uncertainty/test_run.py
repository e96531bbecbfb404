"""Findings of a study: closed forms, plain batches, and that it depends on nothing but the study."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import sledenv
from sledenv import Settings, simulate, simulate_batch
from sledenv.machine.workers import Call
from sledenv.uncertainty import StudyError, run, summary
from sledenv.uncertainty.descents import descend_past
from tests.bodies import same_bits
from tests.uncertainty.make import DROP, PUSH, batch_of, lane_of, made

GRAVITY = 9.81
FEW = 80  # launches a block, at most


def find(base: dict[str, Any], out: Path, **changes: Any) -> sledenv.uncertainty.StudyResult:
    return sledenv.study(made(base, **changes), out, workers=1, progress=False)


def between(low: float, high: float) -> dict[str, Any]:
    return {"kind": "uniform", "low": low, "high": high}


def mean_power(low: float, high: float, power: float) -> float:
    """Mean of x ** power, x uniform."""
    return (high ** (power + 1.0) - low ** (power + 1.0)) / ((power + 1.0) * (high - low))


def product_indices(factors: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Sobol's indices of a product of independent factors of known first and second moments, first order and total."""
    whole = math.prod(second for _, second in factors.values())
    mean = math.prod(first**2 for first, _ in factors.values())
    indices = {}
    for name, (first, second) in factors.items():
        alone = mean / first**2 * (second - first**2)
        rest = whole / second * (second - first**2)
        indices[name] = alone / (whole - mean), rest / (whole - mean)
    return indices


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> sledenv.uncertainty.StudyResult:
    """Descents of a sled that finish, jam and tumble, by one worker without interruption."""
    return find(PUSH, tmp_path_factory.mktemp("push") / "out")


def test_a_fall_ends_where_the_textbook_has_it(tmp_path: Path) -> None:
    """Oracle: u sqrt(2 h / g), launch by launch; its quantiles are those of the drop; speeds u and g t on the way."""
    result = find(DROP, tmp_path / "out")
    table = result.read()
    drop = table["launch.drop_m"].to_numpy()
    assert len(table) == result.launches == 3 * 128
    assert table["stop_m"].to_numpy() == pytest.approx(3.0 * np.sqrt(2.0 * drop / GRAVITY), rel=1e-12)
    for share, name in zip(summary.QUANTILES, summary.NAMES, strict=True):
        expected = 3.0 * math.sqrt(2.0 * (0.5 + 1.5 * share) / GRAVITY)
        found = result.quantiles.set_index("output").loc["stop_m", name]
        assert found == pytest.approx(expected, rel=5e-3)
    for k, x in enumerate((0.0, 0.5, 1.0, 1.5)):
        there = drop > 0.5 * GRAVITY * (x / 3.0) ** 2
        speed = np.where(there, np.hypot(3.0, GRAVITY * x / 3.0), np.nan)
        assert table[f"speed_m_s_{k}"].to_numpy() == pytest.approx(speed, rel=1e-12, nan_ok=True)
        assert table[f"kinetic_j_{k}"].to_numpy() == pytest.approx(speed**2, rel=1e-12, nan_ok=True)
        row = result.envelopes.iloc[k]
        assert row["x_m"] == x
        assert row["moving"] == pytest.approx(there.mean())
        assert row["other"] == pytest.approx((~there).mean())  # the first rebound is the last


def test_sobol_indices_of_a_fall_are_those_of_its_closed_form(tmp_path: Path) -> None:
    """Oracle: t = sqrt(2 h / G), a product: its indices follow from moments. Friction and mass have no effect."""
    bounds = {"launch.drop_m": (0.2, 2.0), "slope.gravity_m_s2": (2.0, 20.0)}
    result = find(
        DROP,
        tmp_path / "out",
        launches=20000,
        launch__speed_m_s=0,
        launch__drop_m=between(*bounds["launch.drop_m"]),
        slope__gravity_m_s2=between(*bounds["slope.gravity_m_s2"]),
        contact__friction=between(0.0, 0.5),
        body__mass_kg=between(1.0, 3.0),
        stations_m=[0.1],
    )
    powers = {"launch.drop_m": 0.5, "slope.gravity_m_s2": -0.5}
    moments = {
        name: (mean_power(*bounds[name], p), math.log(10.0) / 18.0 if p < 0 else mean_power(*bounds[name], 1.0))
        for name, p in powers.items()
    }
    found = result.sobol[result.sobol["output"] == "time_s"].set_index("parameter")
    for name, (first, total) in product_indices(moments).items():
        assert abs(found.loc[name, "first"] - first) < found.loc[name, "first_conf"] < 0.05
        assert abs(found.loc[name, "total"] - total) < found.loc[name, "total_conf"] < 0.05
        assert total > first + 0.005  # there is an interaction to be seen
    for name in ("contact.friction", "body.mass_kg"):
        assert abs(found.loc[name, "first"]) <= found.loc[name, "first_conf"] + 1e-12
        assert found.loc[name, "total"] == pytest.approx(0.0, abs=1e-12)
    assert set(result.sobol["output"]) == {"time_s", "kinetic_j"}  # nothing else varies


def test_passages_are_descents_on_slopes_that_end_there() -> None:
    """Oracle: simulate, one launch and station at a time; slopes of two lengths, one of which ends before a station."""
    study = made(PUSH, slope__length_m=between(3.0, 9.0), body__mass_kg=between(90.0, 120.0), launches=18)
    scenes = study.scenes(study.values(run.draws(study)))
    stations = np.array([0.0, 0.01, 2.0, 6.0, 8.0])
    found = descend_past(scenes, stations, Settings(max_rebounds=200, end_on_chord=True))
    limits = {"max_rebounds": 200, "end_on_chord": True}
    passed = 0
    for i in range(len(scenes.rows)):
        body = study.base.body_section.model_copy(update={"mass_kg": float(scenes.of_body("mass")[i])}).build()
        same_bits(scenes.bodies[scenes.body[i]], body.record[0])
        law, slope, launch = lane_of(scenes, i)
        whole = simulate(body, law, slope, launch, **limits)
        for name in whole.outcome.dtype.names:
            assert whole.outcome[name].tobytes() == found.outcomes[name][i].tobytes(), name
        assert whole.jam.reward == found.jam.reward[i]
        for k, x in enumerate(stations[1:], 1):
            there = simulate(body, law, slope._replace(length=x), launch, **limits) if x <= slope.length else None
            if there is None or there.status != "finish":
                assert np.isnan(found.columns["speed_m_s"][i, k])
                assert np.isnan(found.columns["kinetic_j"][i, k])
            else:
                assert found.columns["speed_m_s"][i, k] == np.hypot(there.state.u, there.state.v)
                assert found.columns["kinetic_j"][i, k] == there.energy.kinetic
                passed += 1
    assert 0.3 * found.columns["speed_m_s"].size < passed < 0.9 * found.columns["speed_m_s"].size
    assert {"finish", "jammed", "tumbled"} <= {
        str(sledenv.kernel.records.STATUS_OF_CODE[code]) for code in found.outcomes["status"]
    }


def test_tables_are_those_of_a_plain_batch(pushed: sledenv.uncertainty.StudyResult) -> None:
    """Oracle: simulate_batch of the same launches, numpy's quantiles, counting."""
    study = pushed.study
    values = study.values(run.draws(study))
    batch = simulate_batch(
        *batch_of(study.scenes(values)), Settings(max_time=60.0, max_rebounds=200, end_on_chord=True)
    )
    table = pushed.read()
    assert np.array_equal(table[list(study.parameters)], values)
    assert (table["status"].astype(str) == batch.status).all()
    outcomes = batch.outcomes
    plain = {"stop_m": outcomes["x"], "time_s": outcomes["t"], "kinetic_j": outcomes["kinetic"]}
    plain |= {"reward": batch.jam.reward, "lost_sliding_j": outcomes["sliding"], "rebounds": outcomes["rebounds"]}
    quantiles = pushed.quantiles.set_index("output")
    for name, output in plain.items():
        assert np.array_equal(table[name], output)
        assert quantiles.loc[name, "mean"] == pytest.approx(output.mean(), rel=1e-13)
        assert quantiles.loc[name, list(summary.NAMES)].tolist() == np.quantile(output, summary.QUANTILES).tolist()
    for row in pushed.shares.itertuples():
        assert row.share == pytest.approx((batch.status == row.status).mean(), abs=1e-15)
        assert row.low <= row.share <= row.high
    assert pushed.shares["share"].sum() == pytest.approx(1.0)
    assert (pushed.shares["share"] > 0.02).sum() >= 3


def test_envelopes_count_every_launch_once_at_every_distance(pushed: sledenv.uncertainty.StudyResult) -> None:
    """Oracle: where each descent ended; a sled that has stopped or finished does not move on."""
    table, envelopes = pushed.read(), pushed.envelopes
    assert len(envelopes) == 21
    ways = envelopes[["moving", "finished", "jammed", "tumbled", "other"]]
    assert ways.sum(axis=1).to_numpy() == pytest.approx(np.ones(21))
    assert (np.diff(envelopes["moving"]) <= 0.0).all()
    last = ways.iloc[-1]
    shares = pushed.shares.set_index("status")["share"]
    assert last["moving"] == 0.0
    assert last["finished"] == pytest.approx(shares["finish"])
    assert last["jammed"] == pytest.approx(shares["jammed"])
    for k, row in envelopes.iterrows():
        stopped = (table["status"] == "tumbled") & (table["stop_m"] < row["x_m"])
        assert row["tumbled"] == pytest.approx(stopped.mean())
        speeds = table[f"speed_m_s_{k}"].dropna()
        assert row["speed_m_s_q75"] == np.quantile(speeds, 0.75)
    assert (envelopes["moving_low"] <= envelopes["moving"]).all()
    assert (envelopes["moving"] <= envelopes["moving_high"]).all()


def contents(result: sledenv.uncertainty.StudyResult) -> dict[str, bytes]:
    files = (file for file in result.folder.rglob("*.parquet"))
    return {str(file.relative_to(result.folder)): file.read_bytes() for file in files}


@pytest.fixture(scope="module")
def blocks(
    pushed: sledenv.uncertainty.StudyResult, tmp_path_factory: pytest.TempPathFactory
) -> sledenv.uncertainty.StudyResult:
    """The same descents by two workers, in smaller blocks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "BLOCK", FEW)
        return sledenv.study(pushed.study, tmp_path_factory.mktemp("blocks") / "out", workers=2, progress=False)


def test_two_workers_find_what_one_does(
    pushed: sledenv.uncertainty.StudyResult, blocks: sledenv.uncertainty.StudyResult
) -> None:
    """Oracle: the launches of one worker in other blocks, bit for bit; blocks do not matter but for the files."""
    assert (len(pushed.files), len(blocks.files)) == (7, 8)
    pd.testing.assert_frame_equal(blocks.read(), pushed.read(), check_exact=True)
    for name in ("shares", "quantiles", "envelopes", "sobol"):
        pd.testing.assert_frame_equal(getattr(blocks, name), getattr(pushed, name), check_exact=True)
        assert (blocks.folder / f"{name}.parquet").read_bytes() == (pushed.folder / f"{name}.parquet").read_bytes()


def test_a_study_that_is_stopped_goes_on_where_it_was_and_simulates_again_what_is_not_as_it_was_left(
    blocks: sledenv.uncertainty.StudyResult,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Oracle: the files of the study that was not stopped.

    Of three blocks that were written the first stays untouched; a number of the second is edited, the third is cut. A
    file of another block is in the place of the fourth, and one that was half written is left by another process.
    """

    def stopping(*_: object) -> Callable[[list[Call]], Iterator[Any]]:
        def make(calls: list[Call]) -> Iterator[Any]:
            for call, given in calls[:3]:
                yield call(*given)
            raise KeyboardInterrupt

        return make

    monkeypatch.setattr(run, "BLOCK", FEW)
    with monkeypatch.context() as patch:
        patch.setattr(run, "runner", stopping)
        with pytest.raises(KeyboardInterrupt):
            sledenv.study(blocks.study, tmp_path / "out", progress=False)
    places = [tmp_path / "out" / "launches" / file.name for file in blocks.files]
    kept, edited, cut, other, *_ = places
    assert sorted(kept.parent.glob("*.parquet")) == places[:3]
    stamp = kept.stat().st_mtime_ns
    table = pd.read_parquet(edited)
    table.loc[5, "stop_m"] = 999.0
    table.to_parquet(edited, index=False)
    cut.write_bytes(cut.read_bytes()[:-100])
    other.write_bytes(kept.read_bytes())
    (kept.parent / ".00003-half.parquet.99").touch()
    result = sledenv.study(blocks.study, tmp_path / "out", workers=1, progress=False)
    assert contents(result) == contents(blocks)
    assert kept.stat().st_mtime_ns == stamp
    told = [f"sledenv: simulating again, because it is not as it was left: {file}" for file in (edited, cut, other)]
    assert caplog.messages == told


def test_blocks_are_as_large_as_they_may_be_and_end_at_powers_of_two() -> None:
    """Oracle: by hand, of groups of 5 launches; one larger than a block is one; groups are a power of two."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "BLOCK", 22)
        assert run._cuts(80, 5) == [5, 10, 20, 40, 60]
        assert run._cuts(5, 5) == []
        assert run._cuts(100, 25) == [25, 50, 75]
    for launches, count in ((1, 3), (3, 3), (4, 6), (7, 12)):
        drawn = run.draws(made(DROP, launches=launches))
        assert drawn.shape == (count, 1)
        assert ((drawn > 0.0) & (drawn < 1.0)).all()


@pytest.mark.parametrize("block", [12, 96, 4096])
def test_more_launches_are_the_same_and_others_after_them(
    block: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the launches of the smaller study, whose files stay; a smaller one does not take them for its own.

    The last block of the smaller one is full or not.
    """
    monkeypatch.setattr(run, "BLOCK", block)
    few = find(DROP, tmp_path / "out", launches=90)
    table, before = few.read(), {path: path.stat().st_mtime_ns for path in few.files}
    many = sledenv.study(few.study, tmp_path / "out", launches=200, workers=1, progress=False)
    assert (few.launches, many.launches) == (96, 384)
    assert many.files[: len(few.files)] == few.files
    assert {path: path.stat().st_mtime_ns for path in few.files} == before
    pd.testing.assert_frame_equal(many.read().iloc[:96], table, check_exact=True)
    with pytest.raises(StudyError, match=r"which is of another study, of more launches or of other physics"):
        find(DROP, tmp_path / "out", launches=90)
    with pytest.raises(StudyError, match=r"out holds launches/0000.*choose another folder, or remove it"):
        find(DROP, tmp_path / "out", launches=200, launch__speed_m_s=4)


def test_a_folder_of_something_else_is_refused_before_anything_is_simulated(tmp_path: Path) -> None:
    (tmp_path / "letters").mkdir()
    (tmp_path / "letters" / "to_mother.txt").touch()
    with pytest.raises(FileExistsError, match=r"holds 'to_mother\.txt', which is not of this command"):
        find(DROP, tmp_path / "letters")
    with pytest.raises(NotADirectoryError, match="is a file"):
        find(DROP, tmp_path / "letters" / "to_mother.txt")
    assert [path.name for path in (tmp_path / "letters").iterdir()] == ["to_mother.txt"]
    with pytest.raises(StudyError, match="is no body"):
        find(PUSH, tmp_path / "new", body__eccentricity_m=between(0.7, 0.95))
    with pytest.raises(ValueError, match="launches = 0"):
        sledenv.study(made(DROP), tmp_path / "new", launches=0)
    assert not (tmp_path / "new").exists()


def test_a_study_without_scatter_has_no_indices(tmp_path: Path) -> None:
    """Oracle: mass changes neither where nor when a body falls without friction; one launch in three groups is none."""
    result = find(DROP, tmp_path / "out", launch__drop_m=1, body__mass_kg=between(1.0, 2.0), launches=1)
    assert set(result.sobol["output"]) <= {"kinetic_j"}
    assert (tmp_path / "out" / "sobol.png").is_file()


@pytest.mark.parametrize(("hits", "count"), [(0, 50), (1, 50), (20, 50), (50, 50)])
def test_the_interval_of_single_launches_is_wilsons(hits: int, count: int) -> None:
    """Oracle: scipy's binomial test."""
    oracle = stats.binomtest(hits, count).proportion_ci(method="wilson")
    share, low, high = summary.interval(np.arange(count) < hits, 1)
    assert share == hits / count
    assert (low, high) == pytest.approx((oracle.low, oracle.high), abs=1e-12)


def test_intervals_of_groups_cover_the_truth() -> None:
    """Oracle: launches of a group that are all alike, 400 experiments: as many draws as groups, not as launches."""
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(400):
        _, low, high = summary.interval(np.repeat(rng.random(200) < 0.3, 5), 5)
        covered += low <= 0.3 <= high
    assert 0.92 <= covered / 400 <= 0.98


def test_what_is_printed_is_what_was_found(pushed: sledenv.uncertainty.StudyResult) -> None:
    lines = pushed.words.splitlines()
    assert max(map(len, lines)) <= 120
    jammed = next(line for line in lines if line.startswith("jammed")).split()
    assert float(jammed[1]) == pytest.approx(pushed.shares.set_index("status").loc["jammed", "share"], abs=1e-4)
    assert "contact.friction" in pushed.words
    assert sorted(path.name for path in pushed.folder.iterdir()) == sorted(run.FILES)
    again = sledenv.uncertainty.load_study(pushed.folder / "study.yaml")
    assert again.key == pushed.study.key
    assert again.launches == pushed.study.launches
