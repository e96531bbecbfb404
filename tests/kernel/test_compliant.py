"""The two-stiffness contact against extended precision, closed forms and published impacts."""

from __future__ import annotations

import json
import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.records import Feature, Mode, Status
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rigid_impact import rigid_impact
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import DEFAULT
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import rod
from tests.oracles import DATA_FILE

REFERENCE = json.loads(DATA_FILE.read_text())
RECORDED = {
    "time": "t",
    "x": "x",
    "phi": "phi",
    "u": "u_after",
    "v": "v_after",
    "omega": "omega_after",
    "duration": "duration",
}
PAPER = segment(1.0, 0.1, 0.05, 7.5e-3)  # the worked example, stiffness apart
LEVEL = Slope(0.0, math.inf, 0.0)
TIGHT = 1e-16  # a tolerance that leaves the rounding error
exactly = partial(simulate, tolerance=TIGHT)


def replay(record: dict[str, Any], rebounds: list[dict[str, str]], tolerance: float = TIGHT) -> Descent:
    """Simulate a descent of the data file; the end of a rod is a corner, a quarter turn from the arc."""
    given, state = record["parameters"], State(**record["state"])
    mass, radius, eccentricity, inertia = (given[name] for name in Segment.fields[:4])
    if radius > 0.0:
        body = segment(mass, radius, eccentricity, inertia)
    else:
        body = rod(mass, eccentricity, inertia)
        state = state._replace(phi=state.phi - 0.5 * math.pi)
    arm = given["rolling_arm"]
    return simulate(
        body,
        ContactLaw(given["stiffness"], given["asymmetry"], given["friction"], arm, arm),
        Slope(given["slope"], math.inf, given["gravity"]),
        state,
        max_rebounds=len(rebounds),
        tolerance=tolerance,
    )


def errors(descent: Descent, rebounds: list[dict[str, str]]) -> list[float]:
    """Per rebound, the largest error of a recorded field, relative to 1 or to the value if that is larger.

    Orientations are counted from that of the launch less its whole turns, those of a corner a quarter turn from it.
    """
    quarter = 0.5 * math.pi
    turns = quarter * round((float(rebounds[0]["phi"]) - descent.rebounds[0]["phi"]) / quarter)
    return [
        max(
            abs(row[ours] + (turns if ours == "phi" else 0.0) - float(exact[theirs]))
            / max(1.0, abs(float(exact[theirs])))
            for theirs, ours in RECORDED.items()
        )
        for row, exact in zip(descent.rebounds, rebounds, strict=True)
    ]


def struck(body: Segment, law: ContactLaw, phi: float, u: float, v: float, omega: float, slope: Slope = LEVEL) -> Any:
    """Record of the single impact of a body that touches the slope and moves towards it."""
    state = State(0.0, support_height(body, phi), phi, u, v, omega)
    descent = exactly(body, law, slope, state, max_rebounds=1, max_time=100.0)
    assert descent.status == Status.LOG_FULL
    return descent.rebounds[0]


@pytest.mark.parametrize(("tolerance", "error"), [(TIGHT, 1e-12), (1e-13, 1e-11), (DEFAULT.tolerance, 1e-9)])
def test_the_reference_descent_is_that_of_extended_precision(tolerance: float, error: float) -> None:
    """Oracle: 20 rebounds in 50 digits from the same doubles, tests/data/reference_descent.json; 8e-14 is reached."""
    record = REFERENCE["reference"]
    rebounds = record["rebounds"]
    assert len(rebounds) == 20
    assert max(errors(replay(record, rebounds, tolerance), rebounds)) < error


@pytest.mark.parametrize("case", REFERENCE["random_cases"], ids=lambda case: case["name"])
def test_bodies_at_the_limits_of_the_model_agree_with_extended_precision(case: dict[str, Any]) -> None:
    """Oracle: extended precision; rounding is amplified by the sensitivity of the case, 1e5 at most."""
    assert max(errors(replay(case, case["rebounds"]), case["rebounds"])) < min(
        1e-10, 1e-14 * max(10.0, float(case["sensitivity"]))
    )


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 0.95])
def test_a_vertical_bounce_leaves_iff_it_is_fast_enough(restitution: float) -> None:
    """Oracle: it leaves iff nu > (2/e^2) sqrt(1 - e^2), physics.md, section 5; otherwise it comes to rest."""
    mass, gravity, stiffness = 2.0, 9.81, 1e6
    body = segment(mass, 0.1, 0.0, 0.01)
    law = ContactLaw.from_restitution(restitution, stiffness=stiffness, friction=0.2, rolling_arm=0.0)
    unit = gravity / math.sqrt(stiffness * (1.0 + law.asymmetry) / mass)
    threshold = 2.0 / restitution**2 * math.sqrt(1.0 - restitution**2)
    slope = Slope(0.0, math.inf, gravity)
    for factor, ending in ((1.0 + 1e-9, Status.LOG_FULL), (1.0 - 1e-9, Status.JAMMED)):
        state = State(0.0, 0.1, 0.0, 0.0, -threshold * factor * unit, 0.0)
        assert exactly(body, law, slope, state, max_rebounds=1).status == ending


STIFF = np.geomspace(1e6, 1e14, 9)


def test_the_worked_example_converges_to_its_rigid_limit_like_the_root_of_the_compliance() -> None:
    """Oracle: section 4 of physics.md, sliding and rolling throughout: p = -(1 + e) v_n0/n, and its golden digits."""
    a, b = 0.05 * math.sin(math.pi / 4), 0.1 - 0.05 * math.cos(math.pi / 4)
    friction, arm, inertia = 0.1, 0.001, 7.5e-3
    # The body is driven to omega < 0 and v_t < 0: F = +f N, M = +delta N.
    lever = -a + b * friction + arm
    n = 1.0 - a * lever / inertia
    p = (1.0 + math.sqrt(1.0 / 3.0)) * 10.0 / n
    rigid = {"u_after": friction * p, "v_after": p - 10.0, "omega_after": lever * p / inertia, "normal_impulse": p}
    golden = {"u_after": 1.3940608, "v_after": 3.9406078, "omega_after": -51.842096, "normal_impulse": 13.940608}
    assert rigid == pytest.approx(golden, abs=5e-7)
    rows = [struck(PAPER, ContactLaw(c, 0.5, friction, arm), math.pi / 4, 0.0, -10.0, 0.0) for c in STIFF]
    for field, exact in rigid.items():
        distances = [abs(row[field] - exact) for row in rows]
        assert np.polyfit(np.log(STIFF), np.log(distances), 1)[0] == pytest.approx(-0.5, abs=0.025)
        assert distances[-1] < 1e-5 * abs(exact)


SPHERE = segment(1e-3, 2.5e-3, 0.0, 0.4e-3 * 2.5e-3**2)
FAST, FALL = 3.9 * math.sqrt(0.5), math.sqrt(9.81)  # [m/s]
GLANCING, STEEPER = (
    (3.9 * math.sin(math.radians(angle)), -3.9 * math.cos(math.radians(angle)), 0.0) for angle in (32.519, 32.521)
)
ROOT = math.sqrt(1.0 / 3.0)
DIGITS = (1e-7, 1e-7, 1e-6)
# Body, friction, rolling arm, restitution, phi, entry and mode; what is published of u, v and omega; how near to that
# rigid surfaces come, and compliant ones of 1e14 N/m.
PUBLISHED: dict[str, tuple[Any, ...]] = {
    "paper": (
        *(PAPER, 0.1, 1e-3, ROOT, math.pi / 4, (0.0, -10.0, 0.0), Mode.SLIDE_ROLL),
        *((1.3940608, 3.9406078, -51.842096), DIGITS, (1e-5, 4e-5, 5e-4)),
    ),
    "rod of Nikravesh": (
        *(rod(1.0, 1.0, 0.01), 0.0, 0.0, 0.95, math.pi / 4, (0.0, -6.5, 0.0), None),
        *((0.0, -6.2514706, -17.5736832), (1e-14, 5e-8, 5e-8), (1e-12, 1e-6, 1e-5)),
    ),
    "disc of Siconos": (  # whose file has 2.781135, the speed after a fall shortened by its time step of 5 ms
        *(segment(1.0, 0.5, 0.0, 0.1), 0.1, 0.0, 0.9, 0.0, (0.0, -FALL, 2.0), Mode.STOP_ROLL),
        *((-2.0 / 7.0, 0.9 * FALL, 4.0 / 7.0), (1e-12, 1e-12, 1e-12), (1e-12, 1e-12, 1e-12)),
    ),
    "sphere": (
        *(SPHERE, 0.092, 0.0, 0.98, 0.3, (FAST, -FAST, 0.0), Mode.SLIDE_ROLL),
        *((0.81784 * FAST, 0.98 * FAST, -502.3456), (1e-8, 1e-11, 5e-5), (1e-8, 1e-11, 5e-5)),
    ),
    "sphere that rolls": (SPHERE, 0.092, 0.0, 0.98, 0.0, GLANCING, Mode.STOP_ROLL, None),
    "sphere that slides": (SPHERE, 0.092, 0.0, 0.98, 0.0, STEEPER, Mode.SLIDE_ROLL, None),
}


@pytest.mark.parametrize("case", PUBLISHED)
def test_published_impacts_come_out(case: str) -> None:
    """Oracle: physics.md, section 9; concentric bodies rebound so at any stiffness, others in the stiff limit."""
    body, friction, arm, restitution, phi, entry, mode, published, *within = PUBLISHED[case]
    law = ContactLaw.from_restitution(restitution, stiffness=1e14, friction=friction, rolling_arm=arm)
    row = struck(body, law, phi, *entry)
    rigid = rigid_impact(body, law, State(0.0, 1.0, phi, *entry))
    assert mode is None or rigid.mode is Mode(row["mode"]) is mode
    if published:
        compliant = [row[f"{name}_after"] for name in ("u", "v", "omega")]
        for found, near in zip((rigid.state[3:], compliant), within, strict=True):
            assert (np.abs(np.array(found) - published) <= near).all()
    if case == "paper":
        assert rigid.normal_impulse == pytest.approx(13.940608, abs=1e-6)
        assert rigid.loss_hysteresis == pytest.approx(44.189956 * (1.0 - restitution**2), abs=1e-6)
        assert [(one.slip, one.spin, one.restitution) for one in rigid.phases] == [(-1, -1, False), (-1, -1, True)]


@pytest.mark.parametrize("stiffness", [1e5, 1e8, math.inf])
def test_a_sliding_disc_begins_to_roll_and_comes_to_rest_on_time(stiffness: float) -> None:
    """Oracle: rolling from 0.185340 s at u = 0.454545, rest at 0.509684 s, x = 0.208507 (physics.md, section 9).

    That is the rigid contact. A compliant one starts without penetration: until it rests, half a period of
    w = sqrt(k+/m), N = m g (1 - cos w t). Its mean is m g, so that later velocities are the same; x gains 2 f g/w^2.
    """
    u0, f, g, r, delta, inertia = 1.0, 0.3, 9.81, 0.5, 0.1, 0.1
    disc, solver = segment(1.0, r, 0.0, inertia), "compliant" if stiffness < math.inf else "rigid"
    law = ContactLaw.from_restitution(
        0.5, stiffness=stiffness if stiffness < math.inf else 1e6, friction=f, rolling_arm=delta
    )
    descent = exactly(disc, law, Slope(0.0), State(0.0, r, 0.0, u0), solver=solver, record="trajectory")
    slides_until = u0 / (f * g + r * g * (f * r - delta) / inertia)
    u_rolling = u0 - f * g * slides_until
    braking = delta * g * r / (inertia + r * r)
    rests_at = slides_until + u_rolling / braking
    distance = slides_until * 0.5 * (u0 + u_rolling) + 0.5 * u_rolling**2 / braking
    assert (slides_until, u_rolling, rests_at, distance) == pytest.approx(
        (0.185340, 0.454545, 0.509684, 0.208507), abs=5e-7
    )
    rolls = descent.trajectory[(descent.trajectory["feature"] != Feature.NONE) & (descent.trajectory["slip"] == 0)]
    assert rolls["t"][0] == pytest.approx(slides_until, abs=1e-13)
    assert rolls["u"][0] == pytest.approx(u_rolling, abs=1e-13)
    assert descent.status == Status.JAMMED
    assert descent.time == pytest.approx(rests_at, abs=1e-13)
    settling = 2.0 * f * g / (stiffness * (1.0 + law.asymmetry))
    assert descent.state.x == pytest.approx(distance + settling, abs=1e-13)
