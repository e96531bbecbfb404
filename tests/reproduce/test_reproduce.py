"""The paper's numbers and figures: values against the known ones, files, and a folder that is whole or not there."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from sledenv import plot, reproduce
from sledenv.closed_forms.wheel import collide_wheel
from sledenv.reproduce import FILES, cases, claims
from sledenv.simulation.scene import State
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height

# id: value, tolerance; docs/physics.md, sections 2 and 4
EXPECTED = {
    "sn_1": (1.0, 1e-5),
    "sn_2": (math.sqrt(1.0 / 3.0), 1e-5),
    "v_1": (math.sqrt(1.0 / 3.0), 1e-12),
    "tau_1": (500.0 * math.pi / math.sqrt(1.5 * 9810.0), 1e-9),
    "tau_2": (500.0 * math.pi / math.sqrt(0.5 * 9810.0), 1e-9),
    "sf_first": (-0.060515, 1e-6),
    "sf_second": (-0.127182, 1e-6),
    "t0_printed_speed": (0.5, 1e-12),
    "speed": (-10.0, 1e-12),
    "t0": (50.0, 1e-12),
    "t_end_euler": (18.8075, 5e-5),
    "t_end_limit": (18.806301, 1e-6),
    "t_end_euler_printed": (24.8979, 5e-5),
    "t_end_limit_printed": (24.8965, 5e-5),
    "t_separation_euler_printed": (25.0, 5e-4),
    "t_separation_printed": (24.9985, 1e-4),
    "separation_printed": (0.0418, 1e-6),
    "separation": (0.037703, 1e-6),
    "elastic_printed": (55.21, 5e-3),
    "elastic": (48.17, 5e-3),
    "slip_directions": (1.0, 0.0),
    "spin_directions": (1.0, 0.0),
    "compression_ends": (0.0129, 5e-5),
    "moment_reverses": (0.0269, 5e-5),
    "depth": (0.078, 5e-4),
    "inertia": (7.5e-3, 1e-15),
    "t_rigid": (18.814409, 1e-6),
    "ledger": (0.0, 1e-12),
    "printed_overlap": (37.5, 0.5),
    "printed_overlap_unit": (62.3, 0.5),
    "corrected_unique": (100.0, 0.0),
    "closed_form_agrees": (100.0, 0.0),
    "scenario_2_printed": (6.0, 1e-12),
    "sled_rebounds": (5.0, 0.0),
}


@pytest.fixture(scope="module")
def ours() -> dict[str, float | str]:
    return {
        **claims.of_wheel(
            cases.disc_impact(0.0), {name: cases.disc_impact(u) for name, u in cases.DISC_SPEEDS.items()}
        ),
        **claims.of_example(cases.worked_example()),
        **claims.of_table_1(),
        **claims.of_sled(cases.sled_descent()),
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("paper") / "out"
    assert reproduce.reproduce(place, progress=lambda line: None) == place
    return place


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_numbers_come_out(ours: dict[str, float | str]) -> None:
    """Oracle: docs/physics.md, sections 2 and 4, computed by independent codes; the closed form of the wheel."""
    for name, (value, tolerance) in EXPECTED.items():
        assert ours[name] == pytest.approx(value, abs=tolerance, rel=0.0), name
    law, disc = cases.EXAMPLE_LAW, cases.DISC
    wheel = disc.mass, disc.inertia, disc.radius, law.friction, law.rolling_arm, law.restitution
    for phase, u0 in cases.DISC_SPEEDS.items():
        closed = collide_wheel(*wheel, u0, cases.PRINTED_SPEED)
        assert (closed.scenario, closed.tangential_impulse) == (
            "stop-roll",
            pytest.approx(ours[f"sf_{phase}"], rel=1e-4),
        )


def test_a_map_of_jamming_is_told_by_its_launches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the descents of a coarse map one by one."""
    monkeypatch.setattr(cases, "JAM_SPINS", (*cases.JAM_SPINS[:2], 3))
    monkeypatch.setattr(cases, "JAM_ORIENTATIONS", (*cases.JAM_ORIENTATIONS[:2], 5))
    (name, friction), *_ = cases.JAM_FRICTIONS.items()
    found = []
    for spin in cases.middles(*cases.JAM_SPINS):
        for phi in np.radians(cases.middles(*cases.JAM_ORIENTATIONS)):
            height = cases.SLED_DROP + support_height(cases.SLED, float(phi))
            launch = State(0.0, height, float(phi), cases.SLED_SPEED, 0.0, float(spin))
            found.append(simulate(cases.SLED, cases.SLED_LAW._replace(friction=friction), cases.SLED_SLOPE, launch))
    jam = [float(one.jam.jam_index) for one in found]
    share = 100.0 * np.mean([one.status != "finish" for one in found])
    told = claims.of_jamming({name: cases.jam_map(friction)})
    assert list(told.values()) == pytest.approx([share, np.mean(jam), min(jam)], rel=1e-12)


def test_what_the_paper_says_is_answered_as_the_numbers_are(ours: dict[str, float | str]) -> None:
    """Oracle: the numbers."""
    why = {claim.id: claim.why for claim in claims.CLAIMS}
    assert len(why) == len(claims.CLAIMS)
    assert why.keys() - ours.keys() == {name for name in why if name.startswith("jam_")}
    finals = [claim.id for claim in claims.CLAIMS if claim.paper == "26.43"]
    assert len(finals) == 4
    assert all("26.43 J not reproducible" in why[name] and abs(ours[name] - 26.43) > 0.5 for name in finals)
    assert ours["moment_reverses"] > ours["compression_ends"]  # not in the first phase
    assert ours["stop_first"] < ours["tau_1"] < ours["stop_second"] < ours["tau_1"] + ours["tau_2"]
    assert ours["sled_status"] == "finish"


def test_the_moment_has_the_sign_by_which_it_was_computed() -> None:
    """Oracle: J times the difference quotient of the spin, row by row."""
    example = cases.worked_example()
    for descent, sign in ((example.euler, "dissipative"), (example.printed, "printed")):
        series, rows = cases.force_series(descent, sign), descent.trajectory  # type: ignore[arg-type]
        rate = descent.body.inertia * np.diff(rows["omega"]) / np.diff(rows["t"])
        middle = 0.5 * (series["moment"][1:] + series["moment"][:-1])
        smooth = np.abs(np.diff(series["normal"])) < 50.0
        assert middle[smooth] == pytest.approx(rate[smooth], abs=0.05)


@pytest.mark.slow
def test_the_folder_is_complete(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    index = (folder / "index.md").read_text(encoding="utf-8")
    assert all(f"]({name})" in index for name in FILES if name != "index.md")
    assert "{" not in index
    for name in FILES:
        content = (folder / name).read_bytes()
        assert len(content) > 500
        assert content.startswith(b"\x89PNG") == name.endswith(".png")


@pytest.mark.slow
def test_the_table_holds_the_numbers(folder: Path, ours: dict[str, float | str]) -> None:
    table = {line["id"]: line for line in read(folder / "table.csv")}
    assert list(table) == [claim.id for claim in claims.CLAIMS]
    assert all(table[name]["ours"] == str(value) for name, value in ours.items())
    markdown = (folder / "table.md").read_text(encoding="utf-8")
    assert all(claim.quantity in markdown for claim in claims.CLAIMS)
    assert {line.count("|") for line in markdown.splitlines() if line.startswith("|")} == {6}


@pytest.mark.slow
def test_the_data_are_those_of_the_figures(folder: Path) -> None:
    """Oracles: the kinetic energies of the table; the descent of a cell; the mirror image of each impact."""
    energies = {line["run"]: float(line["kinetic_j"]) for line in read(folder / "fig_7_10.csv")}
    assert energies["event-driven"] == pytest.approx(18.806301, abs=1e-6)
    assert energies["euler-printed-sign"] == pytest.approx(24.8979, abs=5e-5)
    sled = read(folder / "fig_12_14.csv")
    tilt = math.radians(10.0)
    assert float(sled[0]["vertical_m_s"]) == pytest.approx(-3.0 * math.sin(tilt))
    assert float(sled[0]["horizontal_m_s"]) == pytest.approx(3.0 * math.cos(tilt))
    cell = read(folder / "jam_map.csv")[12345]
    phi = math.radians(float(cell["phi_deg"]))
    height = cases.SLED_DROP + support_height(cases.SLED, phi)
    launch = State(0.0, height, phi, cases.SLED_SPEED, 0.0, float(cell["spin_rad_s"]))
    one = simulate(cases.SLED, cases.SLED_LAW, cases.SLED_SLOPE, launch)
    assert (float(cell["jam_index"]), cell["status"]) == (float(one.jam.jam_index), one.status)
    wheel = read(folder / "table_1.csv")
    assert {line["scenario"] for line in wheel} == {"slide-roll", "stop-roll", "slide", "stuck"}
    number = {"slide-roll": "1", "stop-roll": "2", "slide": "3", "stuck": "4"}
    assert all(number[line["scenario"]] in line["printed_rules"] for line in wheel)
    modes = {
        (line["friction"], float(line["phi_deg"]), float(line["speed_ratio"])): line["mode"]
        for line in read(folder / "mode_map.csv")
    }
    assert all(modes[f, -phi, -speed] == mode for (f, phi, speed), mode in modes.items())


def test_the_phases_of_an_impact_are_its_areas() -> None:
    """Oracle: m V0 and R m V0."""
    figure = plot.plot_impact_phases(cases.disc_impact(0.0))
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["phase I: $S_{NI}$ = 1 N s", "phase II: $S_{NII}$ = 0.5774 N s"]


def test_sliding_is_shown_to_stop_where_it_does() -> None:
    """Oracle: after the impulse p1 of docs/physics.md (3.2); the impulse of a quarter of an oscillation is a cosine."""
    run = cases.disc_impact(0.15)
    figure = plot.plot_sliding_end({"early": run})
    m, r, f, arm = 1.0, 0.1, 0.1, 1e-3
    p1 = 0.15 / (f * (1.0 / m + r**2 / cases.DISC.inertia) - r * arm / cases.DISC.inertia)
    pulsation = math.sqrt(1.5 * 9810.0 / m)
    assert figure.axes[0].get_xlabel() == f"sliding stops at {1e3 * math.acos(1.0 - p1 / m) / pulsation:.2f} ms"


WIDE, ROUND = np.full((3, 4), "slide"), np.ones((3, 4), dtype=int)
X, Y = np.linspace(0.0, 1.0, 4), np.linspace(0.0, 1.0, 3)


@pytest.mark.parametrize(
    ("draw", "given", "message"),
    [
        (plot.plot_table_1, (X, Y, WIDE, WIDE.T), r"'printed' has shape \(4, 3\): must be \(3, 4\)"),
        (plot.plot_mode_map, (X, Y, {"f = 1": ROUND.T}), r"'f = 1' has shape \(4, 3\): must be \(3, 4\)"),
        (plot.plot_jam_map, (X, Y, {"ice": (ROUND.T, ROUND)}), r"'ice' has shape \(4, 3\): must be \(3, 4\)"),
        (plot.plot_mode_map, (X, Y, {}), "panels is empty"),
        (plot.plot_jam_map, (X, Y, {}), "panels is empty"),
        (plot.plot_sliding_end, ({},), "panels is empty"),
        (plot.plot_worked_example, ({},), "series is empty"),
    ],
)
def test_what_cannot_be_drawn_is_named(draw: Callable[..., Figure], given: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        draw(*given)
