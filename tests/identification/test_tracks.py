"""From tracks to laws: recovery of known truths, how often intervals cover them, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binom

import sledenv
from sledenv.command.cli import main
from sledenv.identification.flights import flights_of
from sledenv.identification.recordings import recordings_of
from sledenv.identification.report import plot_track_residuals, write_tracks
from sledenv.identification.tracks import TrackFit, identify_tracks
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import polygon
from tests.identification.drops import BODIES, NOISE, Drop, descent, drop, launch, track

_, DISC, SLED = BODIES
LAW = ("restitution", "friction", "rolling_arm")
# A drop whose two rebounds slip and turn to their end, so that they tell all of the law.
PLAIN = Drop(
    DISC,
    ContactLaw.from_restitution(0.7, stiffness=1e6, friction=0.1, rolling_arm=0.002),
    Slope(0.1),
    State(0.0, 0.35, 0.3, 1.2, 0.0, 2.0),
)
POSES = track(PLAIN, np.random.default_rng(0), seconds=0.5)
# Values that are held where a test is about something else, so that it is fast.
KNOWN = {"restitution": 0.7, "rolling_arm": 0.002}


def cost_of_truth(found: TrackFit, one: Drop) -> float:
    values = {name: one.truth.get(name, value) for name, value in found.fit.values.items()}
    return found.fit.problem.cost(np.array(list(values.values())))


def covered(found: TrackFit, one: Drop, times: float = 1.0) -> dict[str, bool]:
    """Whether the truth is within each interval of the law, made some times as wide."""
    inside = {}
    for name in set(LAW) & set(found.intervals):
        low, high, *_ = found.intervals[name]
        inside[name] = abs(one.truth[name] - 0.5 * (low + high)) <= times * 0.5 * (high - low)
    return inside


@pytest.fixture(scope="module")
def plain() -> TrackFit:
    return identify_tracks(track(PLAIN, np.random.default_rng(0), seconds=0.8), PLAIN.body, PLAIN.slope)


@pytest.fixture(scope="module")
def held() -> TrackFit:
    return identify_tracks(POSES, DISC, PLAIN.slope, fixed=KNOWN)


def test_flights_end_where_the_body_touches_down() -> None:
    """Oracle: the simulated rebounds, to within half of an interval of frames."""
    rng = np.random.default_rng(1)
    for _ in range(4):
        one = drop(rng, DISC)
        (recording,) = recordings_of(track(one, rng), 0.1)
        ends = [flight.end for flight in flights_of(one.body, one.slope, recording)]
        rebounds = descent(one, 1.0).rebounds["t"]
        assert len(ends) >= 2
        np.testing.assert_allclose(ends[:2], rebounds[:2], atol=0.5 / 240.0)


def test_flights_of_exact_poses_are_exact() -> None:
    table = track(PLAIN, np.random.default_rng(0), noise=(0.0, 0.0))
    (recording,) = recordings_of(table, 0.1)
    first, second, *_ = flights_of(PLAIN.body, PLAIN.slope, recording)
    rebounds = descent(PLAIN, 1.0).rebounds
    np.testing.assert_allclose(first.launch, PLAIN.launch, atol=1e-9)
    assert first.end == pytest.approx(rebounds["t"][0], abs=1e-9)
    assert second.launch[3:] == pytest.approx([rebounds[f"{name}_after"][0] for name in ("u", "v", "omega")], abs=1e-7)


@pytest.mark.parametrize(("wrong", "share"), [(0.03, 1.0), (0.0, 1.0 / 3.0)])
def test_the_noise_is_told_from_the_poses_however_frames_are_spaced(wrong: float, share: float) -> None:
    """Some poses are wrong, or two frames in three are lost: parabolas leave no third divided difference."""
    rng = np.random.default_rng(2)
    table = track(PLAIN, rng, rate=1000.0, wrong=wrong)
    (recording,) = recordings_of(table[rng.random(len(table)) < share], 0.1)
    assert recording.noise == pytest.approx(NOISE, rel=0.25)


def test_a_law_and_a_launch_are_recovered(plain: TrackFit) -> None:
    assert all(covered(plain, PLAIN).values())
    assert plain.used.loc["0", "whole"]
    assert plain.used.loc["0", "rebounds"] == len(descent(PLAIN, 0.8 - 1.0 / 240.0).rebounds)
    assert plain.fit.cost <= cost_of_truth(plain, PLAIN)
    assert plain.warnings == []
    found = np.array(plain.launches["0"]) - np.array(PLAIN.launch)
    errors = np.array([plain.fit.errors[name] for name in State._fields])
    assert (np.abs(found) < 4.0 * errors).all()


def test_what_a_mirror_shows_has_the_same_law_and_whole_turns_do_not_matter(held: TrackFit) -> None:
    turned = np.remainder(-POSES["phi_rad"], 2.0 * math.pi)
    assert np.ptp(turned) > 6.0
    mirrored = POSES.assign(x_m=-POSES["x_m"], phi_rad=turned)
    other = identify_tracks(mirrored, DISC, Slope(-PLAIN.slope.angle), fixed=KNOWN)
    assert other.values["friction"] == pytest.approx(held.values["friction"], abs=0.1 * held.fit.errors["friction"])
    for name, sign in zip(State._fields, (-1, 1, -1, -1, 1, -1), strict=True):
        error = sign * getattr(other.launches["0"], name) - getattr(held.launches["0"], name)
        turns = round(error / (2.0 * math.pi)) if name == "phi" else 0
        assert error - turns * 2.0 * math.pi == pytest.approx(0.0, abs=0.1 * held.fit.errors[name])


def test_several_recordings_by_several_cameras_tell_more_than_one() -> None:
    """Frames come at 60 and 1000 per second; some poses of the second are wrong, and some frames are lost."""
    rng = np.random.default_rng(6)
    other = track(PLAIN._replace(launch=launch(rng, DISC)), rng, rate=1000.0, seconds=0.34, wrong=0.04)
    other.loc[[3, 50, 51, 52, 120], "x_m"] = np.nan
    tables = [track(PLAIN, rng, rate=60.0, seconds=0.5).assign(recording="one"), other.assign(recording="two")]
    both = identify_tracks(pd.concat(tables), DISC, PLAIN.slope, fixed=KNOWN)
    alone = identify_tracks(tables[0], DISC, PLAIN.slope, fixed=KNOWN)
    assert all(covered(both, PLAIN, 2.0).values())
    assert all(covered(alone, PLAIN, 2.0).values())
    assert list(both.launches) == ["one", "two"]
    assert both.used["whole"].all()
    assert both.used["frames"].tolist() == [30, 335]
    assert both.fit.errors["friction"] < alone.fit.errors["friction"]


STONE = polygon(1.0, [(0.0, 0.0), (0.2, 0.0), (0.16, 0.15), (0.02, 0.12)], rounding=0.02)


@pytest.mark.parametrize(
    ("body", "launched"),
    [(SLED, State(0.0, 0.45, -1.2, 0.5, 0.0, -1.0)), (STONE, State(0.0, 0.35, 0.3, 0.5, 0.0, 2.0))],
    ids=["a corner", "a rounded polygon"],
)
def test_a_body_with_any_outline_tells_its_law(body: Body, launched: State) -> None:
    """Oracle: the law; the sled hits with its nose, the polygon with two of its corners."""
    one = PLAIN._replace(body=body, launch=launched)
    features = descent(one, 0.5).rebounds["feature"]
    assert len(set(features.tolist())) > 1 if body is STONE else features[0] == sledenv.simulation.Feature.NOSE
    found = identify_tracks(track(one, np.random.default_rng(8), seconds=0.5), body, one.slope, fixed=KNOWN)
    assert all(covered(found, one, 2.0).values())
    arm = body.radius if body is SLED else body.size
    assert found.fit.problem.parameter("corner_rolling_arm").high == arm


def test_a_soft_contact_has_its_stiffness_told() -> None:
    law = PLAIN.law._replace(stiffness=2e4)
    one = PLAIN._replace(law=law)
    table = track(one, np.random.default_rng(10), rate=1000.0, seconds=0.5, solver="compliant")
    found = identify_tracks(table, DISC, one.slope, solver="compliant", fixed=KNOWN)
    interval = found.intervals["stiffness"]
    assert interval.low <= 2e4 <= interval.high
    assert math.log10(interval.high / interval.low) < 0.2
    assert found.table.loc["stiffness", ["value", "low", "high"]].tolist() == [found.values["stiffness"], *interval[:2]]
    assert set(found.intervals) <= set(found.table.index) <= set(found.values)
    assert found.values["stiffness"] == pytest.approx(2e4, rel=0.2)


def test_what_follows_another_law_is_said_not_to_be_explained() -> None:
    """After its first rebound the body is pushed: the recording is used until there."""
    table = track(PLAIN, np.random.default_rng(11), seconds=0.8)
    pushed = table["t_s"] > 0.45
    assert 0.2 < descent(PLAIN, 0.8).rebounds["t"][0] < 0.4
    table.loc[pushed, "x_m"] += 2.0 * (table["t_s"][pushed] - 0.45)
    found = identify_tracks(table, DISC, PLAIN.slope, fixed=KNOWN)
    assert not found.used.loc["0", "whole"]
    assert found.used.loc["0", "until_s"] < 0.5
    assert "explained until" in found.warnings[0]
    assert "fit compliant surfaces" in found.warnings[-1]


@pytest.mark.parametrize(
    ("table", "settings", "words"),
    [
        (POSES.drop(columns="y_m"), {}, "y_m: there is no such column"),
        (POSES.iloc[:5], {}, "5 frames with a pose: must be at least 8"),
        (POSES.iloc[:0], {}, "0 frames"),
        (POSES.iloc[::-1], {}, "t_s, row 1: is .*, must increase within a recording"),
        (POSES.assign(t_s=np.nan), {}, "t_s, row 0: is nan, must be a finite number"),
        (POSES.assign(x_m=np.inf), {}, "x_m, row 0: is inf"),
        (POSES.assign(x_m=np.nan), {}, "0 frames with a pose"),
        (POSES.assign(x_m="1,5"), {}, "x_m, row 0: is '1,5', must be a number, with a decimal point"),
        (POSES.assign(recording=None), {}, "recording, row 0: there is no value"),
        (POSES, {"fixed": {"mass": 1.0}}, "'mass' is no parameter"),
        (POSES, {"fixed": {"restitution": 1.5}}, "restitution"),
        (POSES, {"bounds": {"friction": (0.5, 0.2)}}, "must be in order"),
        (POSES, {"bounds": {"restitution": (0.0, 1.0)}, "solver": "compliant"}, r"in order and in \[0.001, 1\]"),
        (POSES, {"bounds": {"stiffness": (1e3, 1e5)}}, "'stiffness' is not fitted"),
        (POSES, {"bounds": {"friction": (0.0, 1.0)}, "fixed": {"friction": 0.2}}, "'friction' is fixed"),
        (POSES, {"noise": (0.0, 0.1)}, "noise.position"),
        (POSES, {"solver": "exact"}, "solver"),
        (POSES, {"loss": "huber"}, "loss"),
        (POSES.iloc[:36], {}, "touches the slope in no recording"),
    ],
)
def test_a_bad_table_or_argument_is_refused_by_name(table: pd.DataFrame, settings: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        identify_tracks(table, DISC, PLAIN.slope, **settings)


def test_a_track_of_another_body_is_not_explained() -> None:
    with pytest.raises(ValueError, match="no law explains the first rebound"):
        identify_tracks(POSES, segment(1.0, 0.2, 0.02, 0.004), PLAIN.slope, fixed=KNOWN)


def test_identify_tells_tracks_from_rebounds_by_their_columns(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "track.parquet"
    POSES.to_parquet(file)
    found = sledenv.identify(file, DISC, PLAIN.slope, fixed={name: PLAIN.truth[name] for name in LAW})
    assert isinstance(found, TrackFit)
    assert found.intervals == {}
    assert found.launches["0"].u == pytest.approx(PLAIN.launch.u, abs=4.0 * found.fit.errors["u"])
    with pytest.raises(ValueError, match="slope: poses over time need it"):
        sledenv.identify(file, DISC)
    film = pd.read_parquet(file)
    for name in ("t_s", "x_m", "y_m", "phi_rad"):
        with pytest.raises(ValueError, match=f"{name}: there is no such column; poses over time need t_s"):
            sledenv.identify(film.drop(columns=name), DISC, PLAIN.slope)
    rebounds = pd.DataFrame({"phi_rad": [0.0]})
    with pytest.raises(ValueError, match="a table of rebounds does not need it"):
        sledenv.identify(rebounds, DISC, PLAIN.slope)


def test_the_command_prints_the_law_and_writes_pages(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    file, folder = tmp_path / "track.csv", tmp_path / "out"
    POSES.assign(recording="=1+1").to_csv(file, index=False)
    body = ["--gyration-radius", str(math.sqrt(0.004)), "--radius", "0.1", "--eccentricity", "0.02"]
    assert main(["identify", str(file), *body, "--out", str(folder)]) == 2
    assert "--slope-deg: poses over time need it" in capsys.readouterr().err
    slope = ["--slope-deg", str(math.degrees(0.1))]
    fixed = ["--fix", "rolling_arm=0.002", "--fix", "friction=0.1"]
    assert main(["identify", str(file), *body, *slope, *fixed, "--out", str(folder)]) == 0
    assert "restitution" in capsys.readouterr().out
    names = ["launches.csv", "motion_0.html", "parameters.csv", "recordings.csv", "residuals.csv", "residuals_0.png"]
    assert sorted(one.name for one in folder.iterdir()) == names
    table = pd.read_csv(folder / "parameters.csv", index_col=0)
    assert table.loc["restitution", "low"] <= 0.7 <= table.loc["restitution", "high"]
    for name in ("recordings", "launches", "residuals"):
        told = pd.read_csv(folder / f"{name}.csv")["recording"]
        assert (told == "'=1+1").all(), name  # a spreadsheet would run it without the apostrophe


def test_results_are_shown(plain: TrackFit, tmp_path) -> None:  # type: ignore[no-untyped-def]
    assert "restitution" in str(plain)
    assert len(plot_track_residuals(plain).axes) == 3
    write_tracks(plain, tmp_path)
    assert '"ghost":{' in (tmp_path / "motion_0.html").read_text(encoding="utf-8")
    shown = plain.descent().trajectory
    assert shown is not None
    assert np.diff(shown["t"]).max() < 0.0101  # or flights would be drawn as chords of their parabolas
    squares = plain.residuals["noise_levels"] ** 2
    assert squares.mean() == pytest.approx(3.0, rel=0.25)


@pytest.mark.slow
def test_intervals_of_200_drop_tests_cover_at_their_level() -> None:
    """240 frames per second, 1 mm, 0.2 degrees: each interval of level 0.95 covers within the binomial's 99.9 %.

    Either the truth's cost is reached, or the result says that the recording is not explained to its end.
    """
    counts = dict.fromkeys(LAW, 0)
    unseen = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        one = drop(rng)
        found = identify_tracks(track(one, rng), one.body, one.slope)
        for name, hit in covered(found, one).items():
            counts[name] += hit
        if found.fit.cost > cost_of_truth(found, one) + 0.01 and found.used["whole"].all():
            unseen.append(seed)
    print(counts, unseen)
    least = binom.ppf(0.0005, 200, 0.95)
    assert unseen == []
    assert all(count >= least for count in counts.values()), counts
