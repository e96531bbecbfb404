"""Recordings that are spoiled on purpose: what is said before a law is fitted, and that sound ones are let be."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv.command.cli import main
from sledenv.identification.frames import check_frame
from sledenv.identification.plausibility import doubts, other_zero, read_rebounds
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE, Rebounds
from sledenv.identification.recordings import recordings_of
from sledenv.simulation.scene import ContactLaw
from tests.identification.drops import drop, track
from tests.identification.rebound_tables import (
    DISC,
    ECCENTRIC,
    GYRATION,
    SEGMENT,
    SKATE,
    of_body,
    rebounding,
    told_by_arms,
)

Table = pd.DataFrame

U, V, OMEGA = ((before, after) for before, after in zip(BEFORE, AFTER, strict=True))


def scaled(**factors: float) -> Callable[[Table], Table]:
    return lambda table: table.assign(**{name: table[name] * factor for name, factor in factors.items()})


def exchanged(table: Table) -> Table:
    names = dict(zip((*BEFORE, *AFTER), (*AFTER, *BEFORE), strict=True))
    return table.rename(columns=names)


all_of = dict.fromkeys


def by_arms(seed: int, noise: float = 0.02) -> Table:
    rng = np.random.default_rng(seed)
    return rebounding(told_by_arms(rng, 80), rng, noise)


def said(table: Table, **body: object) -> str:
    """Doubts about a table before a fit, or the reason why it is refused."""
    try:
        return " ".join(doubts(read_rebounds(table, **body)))  # type: ignore[arg-type]
    except ValueError as error:
        return str(error)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (scaled(b_m=-1.0), "the sign of b, or of u, or those of a and omega, were turned"),
        (scaled(**all_of(U, -1.0)), "the sign of b, or of u, or those of a and omega, were turned"),
        (scaled(a_m=-1.0), "the sign of a were turned"),
        (scaled(**all_of(OMEGA, -1.0)), "the sign of omega were turned"),
        (scaled(**all_of(OMEGA, np.degrees(1.0))), "omega were in degrees per second"),
        (scaled(**all_of(ARMS, 1e3)), "the arms were in mm"),
        (scaled(**all_of((*U, *V), 1e3)), "u and v were in mm/s"),
        (scaled(a_m=-1.0, **all_of((*V, *OMEGA), -1.0)), "y pointed away from the surface"),
        (scaled(**all_of(V, -1.0)), "the sign of v were turned"),
        (exchanged, "before and after were exchanged"),
    ],
    ids=["b", "u", "a", "omega", "degrees", "mm", "mm/s", "y down", "v", "exchanged"],
)
def test_a_wrong_sign_or_unit_of_rebounds_is_named(spoil: Callable[[Table], Table], words: str) -> None:
    assert words in said(spoil(by_arms(0)), gyration_radius=GYRATION)


def test_a_radius_of_gyration_in_mm_is_named() -> None:
    assert "the radius of gyration were in mm" in said(by_arms(0), gyration_radius=1e3 * GYRATION)


def by_phi(body: sledenv.Body, seed: int = 2, noise: float = 0.0) -> Table:
    """Rebounds of a body, their velocities after with errors of ``noise`` times the speed before."""
    rng = np.random.default_rng(seed)
    table = of_body(body, ContactLaw(1e6, 0.0, 0.12, 0.004), 0.55, rng, 80)
    rebounds = read_rebounds(table, body)
    errors = noise * rng.normal(size=(80, 3)) * rebounds.speed[:, None] / rebounds.scales
    return table.assign(**dict(zip(AFTER, (rebounds.after + errors).T, strict=True)))


DEGREE = 180.0 / np.pi


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (scaled(phi_rad=DEGREE), "phi_rad were in degrees"),
        (scaled(phi_rad=DEGREE, **all_of(OMEGA, DEGREE)), "phi_rad were in degrees, and omega in degrees per second"),
        (scaled(phi_rad=-1.0), "phi_rad alone counted clockwise"),
        (scaled(phi_rad=-1.0, **all_of(OMEGA, -1.0)), "all angles counted clockwise: turn the signs of phi_rad and o"),
        (scaled(phi_rad=-1.0, **all_of((*V, *OMEGA), -1.0)), "y pointed away from the surface"),
        (scaled(**all_of(U, -1.0)), "the sign of u were turned"),
    ],
    ids=["degrees", "degrees of spin too", "clockwise", "clockwise spin too", "y down", "u"],
)
@pytest.mark.parametrize("body", [SEGMENT, SKATE], ids=["symmetric", "not symmetric"])
def test_what_is_wrong_with_an_orientation_is_named(
    body: sledenv.Body, spoil: Callable[[Table], Table], words: str
) -> None:
    table = by_phi(body, noise=0.02)
    assert said(table, body=body) == ""
    found = said(spoil(table), body=body)
    assert f"all would agree if {words}" in found or f", or if {words}" in found
    assert "sign of b," not in found
    assert "zero" not in found


@pytest.mark.parametrize("body", [ECCENTRIC, SEGMENT, SKATE], ids=["eccentric disc", "segment", "hull"])
@pytest.mark.parametrize("offset", [0.3, -0.5, 0.5 * np.pi, 2.5])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_another_zero_of_orientations_is_named_and_nothing_else(
    body: sledenv.Body, offset: float, noise: float
) -> None:
    """Oracle: the angle that was added; the table that the remedy gives is sound."""
    table = by_phi(body, noise=noise)
    found = said(table.assign(phi_rad=table["phi_rad"] + offset), body=body)
    (angle,) = {float(one) for one in re.findall(r"now from another zero, were larger by (\S+) rad", found)}
    assert angle == pytest.approx(-offset, abs=0.05)
    for other in ("degrees,", "degrees per second", "in mm", "or if"):
        assert other not in found
    assert said(table.assign(phi_rad=table["phi_rad"] + offset + angle), body=body) == ""


@pytest.mark.parametrize("body", [DISC, ECCENTRIC, SEGMENT, SKATE])
def test_no_other_zero_is_named_of_sound_rebounds(body: sledenv.Body) -> None:
    """Of a disc nothing could tell it; of the others noise and rolling resistance must not."""
    for seed in range(3):
        assert other_zero(read_rebounds(by_phi(body, seed, 0.04), body)) is None


def test_lengths_of_a_body_in_mm_are_named() -> None:
    table = by_phi(ECCENTRIC)
    for inertia, words in ((1e6, "all lengths of the body were in mm"), (1.0, "the outline of the body were in mm")):
        body = sledenv.segment(ECCENTRIC.mass, 100.0, 50.0, inertia * ECCENTRIC.inertia)
        assert f"all would agree if {words}" in said(table, body=body)


def test_a_fit_that_explains_nothing_warns() -> None:
    """Also after a wrong remedy, as of orientations that were taken for degrees: no table is consistent by it."""
    table = by_phi(SEGMENT, noise=0.02)
    sound = sledenv.identify(table, SEGMENT, starts=2)
    assert not any("differ from the fit" in text for text in sound.warnings)
    for spoilt in (table["phi_rad"] + 0.3, (table["phi_rad"] + 0.5) / DEGREE):
        found = sledenv.identify(table.assign(phi_rad=spoilt), SEGMENT, starts=2)
        assert any("80 rebounds differ from the fit by more than 0.1 of their speed" in text for text in found.warnings)


def test_nothing_is_said_of_sound_rebounds() -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        laws = {"restitution": rng.uniform(0.2, 0.9), "friction": rng.uniform(0.0, 0.5), "rolling_arm": 0.0005}
        assert said(rebounding(told_by_arms(rng, 80), rng, 0.01, **laws), gyration_radius=GYRATION) == ""


def test_friction_that_drives_a_slip_is_noticed_where_spins_balance() -> None:
    """Oracle: the impulses of friction turned, and the spins that follow from them."""
    sound = read_rebounds(by_arms(1, 0.0), gyration_radius=GYRATION)
    after = sound.after.copy()
    after[:, 0] = 2.0 * sound.before[:, 0] - sound.after[:, 0]
    turned = sound.arms[:, 1] * (after[:, 0] - sound.after[:, 0]) / GYRATION**2
    after[:, 2] += turned
    driven = Rebounds(GYRATION, sound.contacts, after, sound.corner, sound.recordings)
    assert any("friction speeds up the slips" in text for text in doubts(driven))


def test_the_command_tells_doubts_before_it_fits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fit that cannot begin, so that what is said was said before it."""
    file = tmp_path / "rebounds.csv"
    scaled(b_m=-1.0)(by_arms(0)).to_csv(file, index=False)
    assert main(["identify", str(file), "--gyration-radius", str(GYRATION), "--fix", "friction=9"]) == 2
    first, last = capsys.readouterr().err.splitlines()
    assert "identify: warning: the spins do not balance" in first
    assert "fixed.friction = 9.0" in last


def test_places_in_a_file_are_its_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A blank line counts, as an editor counts it."""
    file = tmp_path / "rebounds.csv"
    lines = by_arms(0).to_csv(index=False).splitlines()
    lines[5] = lines[5].replace(lines[5].split(",")[2], "fast", 1)
    lines.insert(3, "")
    file.write_text("\n".join(lines))
    assert main(["identify", str(file), "--gyration-radius", str(GYRATION)]) == 2
    assert "line 7: is 'fast', must be a number" in capsys.readouterr().err
    poses = track(drop(np.random.default_rng(0)), np.random.default_rng(0), seconds=0.1)
    poses.loc[4, "t_s"] = 0.0
    poses.to_csv(tmp_path / "poses.csv", index=False)
    with pytest.raises(ValueError, match="t_s, line 6: is 0, must increase within a recording"):
        sledenv.identify(tmp_path / "poses.csv", SEGMENT, sledenv.Slope(0.1))


# --- poses over time -------------------------------------------------------------------------------------------------


def drops(seed: int) -> tuple[Table, sledenv.Body, sledenv.Slope]:
    rng = np.random.default_rng(seed)
    one = drop(rng)
    return track(one, rng), one.body, one.slope


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (scaled(y_m=-1.0, phi_rad=-1.0), "y pointed away from the surface and not down"),
        (scaled(x_m=1e3, y_m=1e3), "x_m and y_m were in mm"),
        (scaled(x_m=1e-3, y_m=1e-3), "give all its lengths in m, not in mm"),
        (scaled(x_m=1e2, y_m=1e2), "x_m and y_m were in cm"),
        (scaled(t_s=1e3), "t_s were in ms"),
        (scaled(x_m=-1.0, phi_rad=-1.0), "x ran downhill"),
        (scaled(phi_rad=180.0 / np.pi), "phi_rad were in degrees"),
        (scaled(phi_rad=-1.0), "phi_rad counted from x to y"),
    ],
    ids=["y down", "mm", "body", "cm", "ms", "uphill", "degrees", "clockwise"],
)
def test_a_wrong_sign_or_unit_of_poses_is_named(spoil: Callable[[Table], Table], words: str) -> None:
    table, body, slope = drops(1)
    with pytest.raises(ValueError, match=words):
        sledenv.identify(spoil(table), body, slope)


def test_nothing_is_said_of_sound_poses() -> None:
    for table, body, slope in map(drops, range(4)):
        check_frame(body, slope, recordings_of(table, body.size))
