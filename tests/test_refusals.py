"""What is given to public functions and is not what they take is refused by name, not by words of Python's."""

from __future__ import annotations

import re
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv import ContactLaw, Slope, State
from sledenv.agents import land_flat, land_parallel
from sledenv.benchmark.oracle import rewards_of
from sledenv.benchmark.problem import Problem
from sledenv.closed_forms.equilibrium import static_jam_angles
from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.sb3 import SledVecEnv, make_vec_env
from sledenv.envs.vector import SledLaunchVector
from sledenv.identification.tracks import identify_tracks
from sledenv.simulation.shapes import lamina

ID = "sledenv/SledLaunch-v0"
DISC, LAW, INCLINE = sledenv.disc(1.0, 0.5), ContactLaw(1e6, 0.5, 0.1, 0.0), Slope(0.1)
LAUNCH = State(0.0, 1.0, 0.0, 1.0, -1.0, 0.0)


def rebounds() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    names = [f"{name}_{when}" for when in ("before", "after") for name in ("u", "v", "omega")]
    units = {"u": "m_s", "v": "m_s", "omega": "rad_s"}
    table = pd.DataFrame(rng.uniform(0.5, 1.0, (20, 6)), columns=[f"{n}_{units[n.split('_')[0]]}" for n in names])
    table["v_before_m_s"] *= -1.0
    return table.assign(a_m=rng.uniform(-0.1, 0.1, 20), b_m=0.2)


def fitted(**given: Any) -> Any:
    return sledenv.identify(rebounds(), **{"gyration_radius": 0.3, "starts": 1} | given)


def tracked(**given: Any) -> Any:
    t = np.arange(9.0)
    poses = pd.DataFrame({"t_s": t, "x_m": t, "y_m": 1.0, "phi_rad": 0.0})
    return identify_tracks(poses, DISC, Slope(0.1), **given)


def differentiated(parameters: Any) -> Any:
    return sledenv.sensitivity(DISC, LAW, Slope(0.1), LAUNCH, parameters=parameters)


def reset(context: dict[str, Any]) -> Any:
    return SledLaunch("sled_snow").reset(options={"context": context})


def made(**given: Any) -> Any:
    return SledLaunch("sled_snow", **given)


def lanes(**given: Any) -> Any:
    return SledLaunchVector(2, "sled_snow").reset(**given)


def restored() -> Any:
    env = SledLaunch("sled_mat")
    env.reset(seed=0)
    return SledLaunch("sled_snow").restore(env.snapshot())


def many(launches: Any, law: Any = LAW, slope: Any = INCLINE) -> Any:
    return sledenv.simulate_batch(DISC, law, slope, launches)


def hit(**given: Any) -> Any:
    return sledenv.rigid_impact(DISC, LAW, LAUNCH, **given)


def resting(slope: Any) -> Any:
    return static_jam_angles(DISC, LAW, slope)


def rewarded(scenario: str, width: int) -> Any:
    problem = Problem(scenario, "descent")
    return rewards_of(problem, problem.contexts("test", 3), np.zeros((3, width)))


def wheel(**given: Any) -> Any:
    good = {"mass": 1.0, "inertia": 0.5, "radius": 1.0, "friction": 0.2, "rolling_arm": 0.01, "restitution": 0.5}
    return sledenv.collide_wheel(**good | {"u": 1.0, "v": -1.0} | given)


def with_options(options: Any) -> Any:
    envs = make_vec_env(ID, 3)
    envs.set_options(options)
    return envs.reset()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fitted(speed_dependent="x"), "speed_dependent = 'x': must be True or False"),
        (lambda: fitted(seed=True), "seed = True: must be an integer >= 0"),
        (lambda: fitted(seed=-1), "seed = -1: must be an integer >= 0"),
        (lambda: fitted(fixed=5), "fixed = 5: must be a mapping of names to values"),
        (lambda: fitted(bounds=5), "bounds = 5: must be a mapping of names to values"),
        (lambda: fitted(bounds={"friction": 5}), "bounds, 'friction' = 5: must be a pair"),
        (lambda: fitted(bounds={"friction": ("a", 1)}), "bounds.friction = 'a': must be a number, a finite number"),
        (lambda: tracked(bounds={"friction": (0, True)}), "bounds.friction = True: must be a number, a finite number"),
        (lambda: tracked(fixed={"friction": "x"}), "fixed.friction = 'x': must be a number, a finite number"),
        (lambda: fitted(start=5), "start = 5: must be a mapping of names to values"),
        (lambda: sledenv.identify(None), "table = None: must be a DataFrame or the path of a file"),
        (lambda: tracked(noise=5), "noise = 5: must be a pair"),
        (lambda: tracked(fixed=5), "fixed = 5: must be a mapping of names to values"),
        (lambda: tracked(seed=-1), "seed = -1: must be an integer >= 0"),
        (lambda: sledenv.study("push_off", "out", workers=0), "workers = 0: must be an integer >= 1"),
        (lambda: ContactLaw(1e6, 0.5, True, 0.0), "ContactLaw.friction = True: must be a number"),
        (lambda: State(0.0, 1.0, np.True_, 1.0, -1.0, 0.0), "State.phi = np.True_: must be a number"),
        (lambda: Slope(10**400), "Slope.angle = 1000"),
        (lambda: reset({"friction": -0.1}), "context.friction = -0.1: must be in [0, inf)"),
        (lambda: reset({"angle": 2.0}), "context.angle = 2.0: must be in (-pi/2, pi/2) rad"),
        (lambda: reset({"speed": np.nan}), "context.speed = nan: must be in [-1e+150, 1e+150]"),
        (lambda: reset({"drop": -0.5}), "context.drop = -0.5: must be in [0, 1e+150] m"),
        (
            lambda: SledDescent("sled_rollers").reset(options={"context": {"zone_friction": 0.5}}),
            "context.zone_friction = 0.5: must be 0, the scenario has no zones",
        ),
        (lambda: lanes(options={"context": [{}, {"friction": -1}]}), "context[1].friction = -1.0: must be in [0, inf)"),
        (lambda: reset([0.1] * 11), "context has shape (11,): must be (12,) or (1, 12), columns angle, friction"),
        (lambda: reset(np.zeros(11)), "context has shape (11,): must be (12,) or (1, 12), columns angle, friction"),
        (lambda: make_vec_env(ID, 2, env_kwargs={"info": ("jam",)}), "env_kwargs['info'] = ('jam',): must be left out"),
        (
            lambda: make_vec_env(ID, 2, scenario="sled_mat"),
            "scenario: is an argument of the environment, give",
        ),
        (lambda: Problem("sled_mat").contexts("test", -1), "contexts = -1: must be an integer >= 0"),
        (lambda: rewarded("sled_rollers", 1), "problem.environment = 'descent': must be 'launch' for launches that"),
        (
            lambda: Problem("sled_rollers", "descent").descend(np.zeros((1, 12)), [[0]]),
            "problem.environment = 'descent'",
        ),
        (
            lambda: land_flat.Agent(Problem("sled_rollers", "descent")),
            "problem.environment = 'descent': must be 'launch'",
        ),
        (
            lambda: land_parallel.Agent(Problem("sled_mat")),
            "problem.environment = 'launch': must be 'descent'",
        ),
        (lambda: sledenv.polygon(1.0, np.zeros((25, 2))), "polygon.points has 25 rows: must have 3 to 24"),
        (
            lambda: sledenv.polygon(1.0, [(0, 0), (1, 0), (0, 1)], centre=(2, 2), inertia=1.0),
            "polygon.centre = (2.0, 2.0): must lie within the outline",
        ),
        (lambda: made().reset(options="test"), "options = 'test': must be a mapping"),
        (lambda: lanes(seed="3"), "seed = '3': must be an integer >= 0"),
        (lambda: made(info=("jam", "jem")), "info = ('jam', 'jem'): must be a sequence of any of 'context', 'launch'"),
        (lambda: reset({"speed": 1e308}), "context.speed = 1e+308: must be in [-1e+150, 1e+150]"),
        (lambda: reset({"spin": -1e308}), "context.spin = -1e+308: must be in [-1e+150, 1e+150]"),
        (lambda: reset({"drop": 1e308}), "context.drop = 1e+308: must be in [0, 1e+150] m"),
        (
            lambda: with_options([{"context": {"speed": 1e308}}, {}, {}]),
            "context[0].speed = 1e+308: must be in [-1e+",
        ),
        (lambda: lanes(options={"context": {"fall": [0.0, 1e308]}}), "context[1].fall = 1e+308: must be in [-1e+150"),
        (lambda: made().reset(seed=True), "seed = True: must be an integer >= 0"),
        (lambda: made().reset(seed=-1), "seed = -1: must be an integer >= 0"),
        (lambda: lanes(seed=-1), "seed = -1: must be an integer >= 0"),
        (lambda: lanes(seed=[0, True]), "seed[1] = True: must be an integer >= 0"),
        (lambda: lanes(seed=np.array(1.0)), "seed = array(1.): must be an integer >= 0, or a sequence of one per lane"),
        (lambda: make_vec_env(ID, 2, seed=True), "seed = True: must be an integer >= 0"),
        (lambda: made(render_mode=5), "render_mode = 5: must be one of 'human', 'rgb_array'"),
        (lambda: made(render_mode=np.zeros(2)), "render_mode = array([0., 0.]): must be one of 'human', 'rgb_array'"),
        (
            lambda: made(noise=0),
            "SledLaunch.__init__() got an unexpected keyword argument 'noise'; it has scenario, control, render_mode, "
            "info, solver, split, launch_noise, observe",
        ),
        (
            lambda: SledDescent(trims=1),
            "SledDescent.__init__() got an unexpected keyword argument 'trims'; it has scenario,",
        ),
        (
            lambda: make_vec_env(ID, 2, env_kwargs={"noise": 0}),
            "SledLaunchVector.__init__() got an unexpected keyword argument 'noise'; it has num_envs",
        ),
        (lambda: SledLaunch("sled_snwo"), "unknown scenario 'sled_snwo' (did you mean 'sled_snow'?)"),
        (lambda: made(control="trim"), "control = 'trim': must be one of 'both', 'orientation', 'spin'"),
        (lambda: made(solver="exact"), "solver = 'exact': must be one of 'compliant', 'rigid'"),
        (lambda: made(split="exam"), "split = 'exam': must be one of 'train', 'validation', 'test'"),
        (lambda: made(launch_noise=0.1), "launch_noise = 0.1: must be two numbers"),
        (lambda: made(launch_noise=(0.1, -1.0)), "launch_noise.spin = -1.0: must be in [0, inf)"),
        (lambda: made(launch_noise=(np.nan, 0.0)), "launch_noise.orientation = nan: must be in [0, inf)"),
        (lambda: made(solver=np.zeros(2)), "solver = array([0., 0.]): must be one of 'compliant', 'rigid'"),
        (lambda: made(split=["test"]), "split = ['test']: must be one of 'train', 'validation', 'test'"),
        (restored, "snapshot.task['scenario'] = ('sled_mat', "),
        (lambda: reset({"speed": True}), "context.speed = True: must be a number"),
        (lambda: differentiated(5), "parameters = 5: must be a sequence of names, at least one"),
        (lambda: sledenv.load_scenario("sled_snow").sample(None), "rng = None: must be a numpy.random.Generator"),
        (lambda: SledVecEnv(None), "env = None: must be a native vector environment, not wrapped"),
        (lambda: make_vec_env(ID, 2, info=None), "info = None: must be a sequence of any of 'context', 'launch'"),
        (lambda: make_vec_env(ID, 2, info=[[]]), "info = [[]]: must be a sequence of any of 'context', 'launch'"),
        (lambda: make_vec_env(ID, 2, env_kwargs=5), "env_kwargs = 5: must be a mapping of names to values"),
        (lambda: with_options(5), "options = 5: must be a mapping, or a list of one per lane"),
        (
            lambda: many([[0.0, 1.0, 0.0, True, -1.0, 0.0]]),
            "launches holds True or False: must hold numbers, columns x",
        ),
        (lambda: many(np.ones((2, 6), bool)), "launches holds True or False: must hold numbers, columns x, y"),
        (lambda: many(np.ones((2, 6), complex)), "launches holds complex128: must hold numbers, columns x, y"),
        (
            lambda: many([LAUNCH], law=[(1e6, 0.5, True, 0.0, 0.0)]),
            "law holds True or False: must hold numbers, columns",
        ),
        (lambda: many([LAUNCH], slope=[(True, 9.0, 9.81)]), "slope holds True or False: must hold numbers, columns"),
        (lambda: sledenv.Ride(DISC, LAW, Slope(0.1), LAUNCH, rotor_inertia=1.0).trim(10**400), "Ride.trim.spin = 1000"),
        (
            lambda: sledenv.identify(rebounds() * 1j, gyration_radius=0.3),
            "u_before_m_s: must be numbers, is of the type",
        ),
        (lambda: many([LAUNCH], slope=[(0.1, 10**400, 9.81)]), "slope holds 1000000"),
        (lambda: sledenv.polygon(1.0, [(0, 0), (10**400, 0), (1, 1)]), "polygon.points holds 1000000"),
        (lambda: sledenv.polygon(1.0, [(0, 0), (1e200, 0), (1, 1)]), "polygon.points[1] = 1e+200: must be in [-1e+50"),
        (
            lambda: sledenv.hull(1.0, [(0, 0, 1e60)]),
            "hull.circles[0] = 1e+60: must be in [-1e+50",
        ),
        (lambda: lamina(1.0, []), "lamina.arcs has 0 arcs: must have 1 to "),
        (lambda: lamina(1.0, 3), "lamina.arcs = 3: must be a sequence of arcs"),
        (lambda: lamina(1.0, [(0.0, 0.0, "1", 0.0)]), "lamina.arcs[0].radius = '1': must be a number in [0, inf)"),
        (lambda: lamina(1.0, [(0.0, 0.0, 1.0, 0.0)] * 2), "lamina.arcs[1].begin = 0.0: must rise from arc to arc"),
        (lambda: lamina(1.0, DISC.arcs, 1.0, (2.0, 0.0)), "lamina.centre = (2.0, 0.0): must lie within the outline"),
        (lambda: lamina(1.0, DISC.arcs, centre=(0.0, 0.0)), "lamina.inertia = None: must be given where lamina.cent"),
        (lambda: sledenv.Settings(max_rebounds=10**400), "Settings.max_rebounds = 1000000"),
        (lambda: resting(INCLINE._replace(zones=[(1, 2, 0.1, 0, 0)])), "Slope.zones has 1 entries: must be empty"),
        (lambda: resting(INCLINE._replace(profile=[(1, 0), (2, 1)])), "Slope.profile has 2 entries: must be empty"),
        (lambda: hit(hypothesis=np.zeros(2)), "hypothesis = array([0., 0.]): must be one of 'energetic', 'poisson'"),
        (lambda: wheel(mass="1.0"), "mass = '1.0': must be numbers, each in (0, inf)"),
        (lambda: wheel(inertia=b"1"), "inertia = b'1': must be numbers, each in (0, inf)"),
        (lambda: wheel(radius=True), "radius = True: must be numbers, each in (0, inf)"),
        (lambda: wheel(friction=10**400), "friction holds 1000000"),
        (lambda: wheel(u=[1.0, True]), "u holds True or False: must hold numbers, each a finite number"),
        (lambda: wheel(v=np.ma.masked), "v is a masked array, or holds one: must hold numbers, each a finite number"),
        (lambda: sledenv.study("push_off", "out", launches=10**400), "launches = 1000000"),
        (lambda: with_options([{}, {}]), "options has 2 entries: must be one per lane, 3"),
    ],
)
def test_what_is_not_taken_is_refused_by_name(call: Callable[[], Any], message: str) -> None:
    """Oracle: the message, which has the name, the value and what is allowed."""
    with pytest.raises((TypeError, ValueError), match=f"^{re.escape(message)}"):
        call()


@pytest.mark.parametrize(
    "value",
    [
        pytest.param(Decimal(1), id="Decimal"),
        pytest.param(bytearray(b"1"), id="bytearray"),
        pytest.param(memoryview(b"1"), id="memoryview"),
        pytest.param(np.timedelta64(1, "s"), id="timedelta64"),
    ],
)
def test_what_is_no_real_number_is_none_of_a_body(value: Any) -> None:
    """Oracle: the error that words have; float() or NumPy would make 1.0 of each."""
    for call in (
        lambda: sledenv.disc(value, 1.0),
        lambda: sledenv.sled(value),
        lambda: sledenv.sled(sled_mass=value),
        lambda: sledenv.Body(value, 1.0, DISC.arcs),
    ):
        with pytest.raises(TypeError, match=r"mass = .*: must be a number in \[1e-50, 1e\+50\]"):
            call()
    for points in ([(0.0, 0.0), (value, 0.0), (0.0, 1.0)], value):
        with pytest.raises(TypeError, match=r"polygon\.points.*: must (hold|be) numbers"):
            sledenv.polygon(1.0, points)
