"""SledDescent is SledLaunch in slow motion: without trims bit for bit, and it goes on from any rebound in many ways."""

from __future__ import annotations

import copy
import pickle
from functools import partial
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import sledenv
from sledenv import STATUS_OF_CODE
from sledenv.envs import DESCENT_ID, LAUNCH_ID, register
from sledenv.envs.descent import SledDescent
from sledenv.envs.inputs import SEEN
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import FLIGHT
from sledenv.simulation.support import support_height
from tests.own_scenarios import own_scenario

SLED_SCENARIOS = (own_scenario("brake_mat"), own_scenario("ice_drop"), own_scenario("ice_fast"))
CONTROLS = ("both", "orientation", "spin")
SOLVERS = ("compliant", "rigid")
TURN = 2.0 * np.pi


equal = partial(data_equivalence, exact=True)  # in types, dtypes, keys and values


def random_action(env, rng):
    return rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)


def play(env, rng) -> list:
    """Step with random actions to the end of the episode; return all that the steps gave."""
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(random_action(env, rng)))
    return steps


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("scenario", SLED_SCENARIOS)
def test_both_checkers_pass_without_a_warning(scenario, control):
    """Oracle: Gymnasium's and SB3's check_env; pytest turns warnings into errors."""
    env = gym.make(DESCENT_ID, scenario=scenario, control=control)
    check_env(env.unwrapped, skip_render_check=scenario != own_scenario("brake_mat"))
    check_env_sb3(env.unwrapped)


@pytest.mark.parametrize(
    ("scenario", "solver"),
    [
        (own_scenario("brake_mat"), "compliant"),
        (own_scenario("brake_mat"), "rigid"),
        (own_scenario("ice_drop"), "rigid"),
        (own_scenario("ice_fast"), "compliant"),
    ],
)
def test_without_trims_the_return_is_the_reward_of_the_launch_bit_for_bit(scenario, solver):
    """Oracle: SledLaunch in 400 contexts altogether; the last info is the same in every entry."""
    rng = np.random.default_rng(0)
    statuses = set()
    control = {"brake_mat": "both", "ice_drop": "orientation", "ice_fast": "spin"}[Path(scenario).stem]
    launch, descent = (kind(scenario, control, solver=solver) for kind in (SledLaunch, SledDescent))
    launch.reset(seed=1)
    descent.reset(seed=1)
    for _ in range(150 if solver == "compliant" else 50):  # a rigid descent bounces until it settles
        action = random_action(launch, rng)
        context, _ = launch.reset()
        observation, _ = descent.reset()
        assert np.array_equal(observation[:SEEN], context)
        assert not observation[11:].any()
        _, reward, _, _, info = launch.step(action)
        total, ended, steps = 0.0, False, 0
        while not ended:
            # What is not used must not matter: the trim of the first step, the launch of the others.
            unused = random_action(descent, rng)
            given = np.append(action, unused[-1]) if steps == 0 else np.append(unused[:-1], np.float32(0.0))
            observation, part, terminated, truncated, last = descent.step(given)
            assert descent.observation_space.contains(observation)
            ended, total, steps = terminated or truncated, total + part, steps + 1
        assert total == reward
        assert last == info
        assert terminated == (STATUS_OF_CODE[last["descent"]["status"]] in ("finish", "jammed", "tumbled"))
        times = last["rebounds"]["t"]
        in_contact = times[-1:] == [last["descent"]["time"]]
        assert steps == len(times) + (not in_contact)
        statuses.add(STATUS_OF_CODE[last["descent"]["status"]])
    assert {"brake_mat": {"finish", "tumbled"}}.get(scenario, {"finish"}) <= statuses


@pytest.mark.parametrize(
    ("scenario", "solver"),
    [
        (own_scenario("brake_mat"), "compliant"),
        (own_scenario("ice_drop"), "rigid"),
        (own_scenario("ice_fast"), "compliant"),
    ],
)
def test_the_ledger_closes_in_every_step_and_the_work_of_the_trims_is_charged(scenario, solver):
    """Oracle: conservation of energy; supply, work and reward by hand."""
    env = SledDescent(scenario, solver=solver)
    env.reset(seed=3)
    rng = np.random.default_rng(2)
    rider = env.task.scenario.rider
    worked = False
    for _ in range(60):
        env.reset()
        for observation, reward, terminated, truncated, info in play(env, rng):
            energy = sledenv.Energy(**info["descent"]["energy"])
            assert abs(energy.residual) <= 1e-12 * energy.turnover
            bound = (env.task.bodies[0].inertia * rider.trim_rad_s) ** 2 / (2.0 * rider.rotor_inertia_kg_m2)
            assert 0.0 <= energy.rotor <= bound * (1.0 + 1e-6)
            assert abs(observation[17]) <= 1.0
            worked |= energy.work > 0.0
            assert 0.0 <= reward <= 1.0
            assert reward == 0.0 or terminated or truncated
        jam = info["jam"]
        assert reward == 0.5 * jam["progress"] + 0.5 * np.sqrt(jam["retention"])
        if terminated and info["is_success"]:
            outcome = env.episodes.viewers[0]._recorded()
            kept = 0.5 * env.task.bodies[0].mass * max(outcome.state.u, 0.0) ** 2
            launch, slope, body = outcome.launch, outcome.slope, outcome.body
            lowest = min(body.radius - body.eccentricity, body.eccentricity - body.radius * np.cos(body.half_angle))
            supplied = (
                0.5 * body.mass * (launch.u**2 + launch.v**2)
                + 0.5 * body.inertia * launch.omega**2
                + body.mass * slope.gravity * ((launch.y - lowest) * np.cos(slope.angle) + 10.0 * np.sin(slope.angle))
                + outcome.energy.work
            )
            assert jam["retention"] == pytest.approx(kept / supplied, rel=1e-12)
    assert worked


def test_the_observation_of_the_flight_is_the_state_at_the_rebound():
    """Oracle: the last rebound of the info, scaled by hand as docs/environments.md says."""
    env = SledDescent(own_scenario("brake_mat"))
    env.reset(seed=8)
    rng = np.random.default_rng(1)
    scenario = env.task.scenario
    speed, spin = env.task._speed, env.task._spin
    body = env.task.bodies[0]
    height = 1.5 + body.radius + body.eccentricity + 10.0 * np.sin(np.radians(12.0))
    assert speed == pytest.approx(np.sqrt(6.0**2 + body.inertia / body.mass * 8.0**2 + 2.0 * 9.81 * height), rel=1e-12)
    assert spin == pytest.approx(speed * np.sqrt(body.mass / body.inertia), rel=1e-12)
    seen = 0
    for _ in range(20):
        env.reset()
        held = 0.0
        while True:
            action = random_action(env, rng)
            held = float(action[-1]) if env.episodes.steps[0] else 0.0
            observation, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                break
            last = {name: column[-1] for name, column in info["rebounds"].items()}
            expected = (
                last["x"] / 10.0, np.sin(last["phi"]), np.cos(last["phi"]), last["u_after"] / speed,
                last["v_after"] / speed, last["omega_after"] / spin, held, last["t"] / scenario.limits.max_time_s,
                len(info["rebounds"]["t"]) / scenario.limits.max_rebounds,
            )  # fmt: skip
            assert len(expected) == len(FLIGHT)
            assert observation[11:] == pytest.approx(expected, abs=1e-6)
            seen += 1
    assert seen > 50


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_polygon_is_seen_as_it_flies(solver):
    """Oracle: conservation of energy, by which no velocity leaves (-1, 1); the rebounds of the info."""
    content = sledenv.load_scenario(own_scenario("brake_mat")).model_dump(by_alias=True)
    points = [[0.0, 0.0], [1.0, 0.0], [0.9, 0.5], [0.1, 0.6]]
    content["body"] = {"kind": "polygon", "mass_kg": 100, "points_m": points}
    env = SledDescent(sledenv.Scenario.model_validate(content), solver=solver)
    check_env(env, skip_render_check=True)
    rng, seen = np.random.default_rng(1), 0
    for seed in range(10):
        env.reset(seed=seed)
        for observation, _, terminated, truncated, info in play(env, rng):
            if not (terminated or truncated):
                assert np.abs(observation[14:17]).max() < 1.0
                states, _ = env.task.flights_seen(observation[np.newaxis])
                last = {name: column[-1] for name, column in info["rebounds"].items()}
                expected = [last["x"], *(last[f"{name}_after"] for name in ("u", "v", "omega"))]
                assert states[0, [0, 3, 4, 5]] == pytest.approx(expected, abs=1e-4)
                turned = states[0, 2] - last["phi"]
                assert turned - TURN * np.rint(turned / TURN) == pytest.approx(0.0, abs=1e-6)
                assert states[0, 1] == pytest.approx(support_height(env.task.bodies[0], states[0, 2]))
                seen += 1
    assert seen > 20


@pytest.mark.parametrize("solver", SOLVERS)
def test_alternatives_roll_out_from_the_same_impact_and_the_way_back_is_exact(solver):
    """Oracle: the uninterrupted episode and, for an alternative, a twin that came there by itself; streams included."""
    for seed in range(3):
        env, twin = (SledDescent(own_scenario("ice_drop"), solver=solver, launch_noise=(0.1, 0.2)) for _ in range(2))
        env.reset(seed=seed)
        snapshots, steps = [env.snapshot()], []
        rng = np.random.default_rng(seed)
        actions = [random_action(env, rng) for _ in range(300)]
        for action in actions:
            steps.append(env.step(action))
            snapshots.append(env.snapshot())
            if steps[-1][2] or steps[-1][3]:
                break
        following = env.reset()
        returns = set()
        for i in rng.choice(len(steps), min(len(steps), 4), replace=False).tolist():
            for k in range(2):  # alternatives, also one after the other from the same snapshot
                env.restore(snapshots[i])
                other = np.random.default_rng([seed, k])
                rollout = play(env, other)
                twin.reset(seed=seed)
                for action in actions[:i]:
                    twin.step(action)
                assert equal(rollout, play(twin, np.random.default_rng([seed, k])))
                returns.add(rollout[-1][1])
            elsewhere = SledDescent(own_scenario("ice_drop"), solver=solver, launch_noise=(0.1, 0.2))
            for target in (env, elsewhere):
                target.restore(pickle.loads(pickle.dumps(snapshots[i])))
                assert equal([target.step(action) for action in actions[i : len(steps)]], steps[i:])
                assert equal(target.reset(), following)
        assert len(steps) == 1 or len(returns) > 1


@pytest.mark.parametrize("kind", [SledLaunch, SledDescent])
def test_pickles_and_copies_made_at_any_time_go_on_identically(kind):
    for made in (copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))):
        env = kind(own_scenario("ice_drop"), launch_noise=(0.1, 0.2))
        twin = made(env)
        assert equal(env.reset(seed=5), twin.reset(seed=5))
        for i in range(30):
            twin = made(twin)
            action = random_action(env, np.random.default_rng(i))
            one, other = env.step(action), twin.step(action)
            assert equal(one, other)
            if one[2] or one[3]:
                twin = made(twin)
                assert equal(env.reset(), twin.reset())


def test_a_time_limit_truncates_with_the_reward_of_what_was_done():
    """Oracle: SledLaunch, whose one step terminates; paper_impact has 0.04 s for its only impact, and no rider."""
    launch, descent = SledLaunch("paper_impact"), SledDescent("paper_impact")
    launch.reset(seed=0)
    descent.reset(seed=0)
    action = np.array([0.25, 0.1], np.float32)
    _, reward, terminated, truncated, info = descent.step(np.append(action, np.float32(1.0)))
    while not (terminated or truncated):
        _, reward, terminated, truncated, info = descent.step(np.ones(3, np.float32))
    assert (terminated, truncated) == (False, True)
    assert STATUS_OF_CODE[info["descent"]["status"]] == "timeout"
    assert reward == launch.step(action)[1]
    content = sledenv.load_scenario(own_scenario("ice_drop")).model_dump(mode="json")
    content["limits"]["max_rebounds"] = 2
    env = SledDescent(sledenv.Scenario.model_validate(content))
    ends = set()
    env.reset(seed=0)
    for i in range(20):
        env.reset()
        steps = play(env, np.random.default_rng(i))
        ends.add((steps[-1][2], steps[-1][3], STATUS_OF_CODE[steps[-1][4]["descent"]["status"]]))
        assert len(steps) <= 3
    assert (False, True, "log_full") in ends


@pytest.mark.parametrize("action", [[2.0, 0.0, 0.0], [0.0, 0.0, np.nan], [0.0, 0.0], [[0.0, 0.0, 0.0]], 0.0, "left"])
def test_a_wrong_action_is_refused_at_the_launch_and_at_a_rebound_and_the_episode_goes_on(action):
    """Oracle: a twin that was given right actions alone."""
    env, twin = (SledDescent(own_scenario("ice_drop")) for _ in range(2))
    env.reset(seed=0)
    twin.reset(seed=0)
    for i in range(3):
        with pytest.raises(InvalidAction, match="action"):
            env.step(action)
        right = random_action(env, np.random.default_rng(i))
        assert equal(env.step(right), twin.step(right))


def test_misuse_gets_gymnasiums_errors_and_leaves_the_environment_usable():
    """Oracle: a twin that was not misused."""
    env, twin = (SledDescent(own_scenario("ice_drop")) for _ in range(2))
    for call in (lambda: env.step(np.zeros(3, np.float32)), env.render, env.snapshot):
        with pytest.raises(ResetNeeded):
            call()
    env.reset(seed=4)
    twin.reset(seed=4)
    other = SledDescent(own_scenario("ice_drop"), "spin")
    other.reset(seed=0)
    for wrong, error, message in (
        (other.snapshot(), ValueError, "of another task"),
        ({"x": 1}, TypeError, r"must come from snapshot\(\)"),
    ):
        with pytest.raises(error, match=message):
            env.restore(wrong)
    for options, error, message in (
        ({"contxt": 1}, ValueError, "unknown option 'contxt': must be one of 'context', 'split'"),
        ({"split": "exam"}, ValueError, "split = 'exam': must be one of 'train', 'validation', 'test'"),
        ({"context": {"frition": 0.1}}, ValueError, "unknown field 'frition' of context: must be one of angle"),
        ({"context": {"drop": "high"}}, TypeError, "context.drop"),
        ({"context": {"drop": [0.1, 0.2]}}, ValueError, r"context.drop has shape \(2,\): must be \(\) or \(1,\)"),
        ({"context": [1.0, 2.0]}, ValueError, r"context has shape \(2,\)"),
    ):
        with pytest.raises(error, match=message):
            env.reset(seed=1, options=options)
    rng, same = np.random.default_rng(0), np.random.default_rng(0)
    assert equal(play(env, rng), play(twin, same))
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(3, np.float32))
    assert equal(env.reset(), twin.reset())


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scenario": "sled_snwo"}, sledenv.ScenarioError, "sled_snow"),
        ({"control": "trim"}, ValueError, "control = 'trim': must be one of 'both', 'orientation', 'spin'"),
        ({"solver": "exact"}, ValueError, "solver = 'exact': must be one of 'compliant', 'rigid'"),
        ({"split": "exam"}, ValueError, "split = 'exam': must be one of 'train', 'validation', 'test'"),
        ({"launch_noise": 0.1}, ValueError, "launch_noise = 0.1: must be two numbers"),
        ({"launch_noise": (0.1, -1.0)}, ValueError, r"launch_noise.spin = -1.0: must be in \[0, inf\)"),
        ({"launch_noise": (np.nan, 0.0)}, ValueError, r"launch_noise.orientation = nan: must be in \[0, inf\)"),
        ({"render_mode": "ascii"}, ValueError, "render_mode = 'ascii'"),
    ],
)
def test_bad_arguments_name_the_argument_and_what_is_allowed(arguments, error, message):
    for kind in (SledLaunch, SledDescent):
        with pytest.raises(error, match=message):
            kind(**arguments)


@pytest.mark.parametrize("mode", [np.nan, 3, np.zeros(2), ["ansi"]], ids=str)
def test_a_render_mode_that_is_no_word_is_named_before_gymnasium_takes_it_for_one(mode):
    with pytest.raises(ValueError, match=r"render_mode = .*: must be one of 'human', 'rgb_array', 'rgb_array_list'"):
        gym.make(DESCENT_ID, render_mode=mode)


def test_the_spec_survives_json_and_a_second_registration_is_silent():
    arguments = {"scenario": own_scenario("ice_fast"), "solver": "rigid", "split": "test", "launch_noise": [0.1, 0.0]}
    for name in (LAUNCH_ID, DESCENT_ID):
        env = gym.make(name, **arguments)
        again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
        assert equal(env.reset(seed=2), again.reset(seed=2))
    register()


class Session(RuleBasedStateMachine):
    """Any order of calls: whatever happens, each episode is the one that a plain twin replays from its beginning."""

    kind: type[SledLaunch]
    solver = "compliant"

    @initialize(split=st.sampled_from([None, "train", "test"]), noise=st.sampled_from([(0.0, 0.0), (0.2, 0.5)]))
    def make(self, split, noise):
        arguments = {"scenario": own_scenario("ice_fast"), "split": split, "launch_noise": noise, "solver": self.solver}
        self.env = self.kind(render_mode="rgb_array", **arguments)
        self.twin = self.kind(**arguments)
        self.history: list | None = None  # of calls since the last seeded reset, with what they gave
        self.taken: list = []

    def tell(self, name, *args, **kwargs):
        """Call the environment and remember the call."""
        given = getattr(self.env, name)(*args, **kwargs)
        self.history.append((name, args, kwargs, copy.deepcopy(given)))
        return given

    @property
    def ended(self):
        """Whether a step needs a reset first."""
        name, _, _, given = self.history[-1]
        return name == "step" and (given[2] or given[3])

    @rule(seed=st.integers(0, 50))
    def reset_with_a_seed(self, seed):
        self.history = []
        self.tell("reset", seed=seed)

    @precondition(lambda self: self.history)
    @rule(options=st.sampled_from([None, {"context": {"friction": 0.05}}, {"split": "validation"}]))
    def reset(self, options):
        self.tell("reset", options=options)

    @precondition(lambda self: self.history and not self.ended)
    @rule(values=st.tuples(*[st.floats(-1.0, 1.0, width=32)] * 3))
    def step(self, values):
        observation, *_ = self.tell("step", np.array(values[: self.env.action_space.shape[0]], np.float32))
        assert self.env.observation_space.contains(observation)

    @precondition(lambda self: self.history and self.ended)
    @rule()
    def step_after_the_end(self):
        with pytest.raises(ResetNeeded):
            self.env.step(np.zeros(self.env.action_space.shape, np.float32))

    @precondition(lambda self: not self.history)
    @rule(name=st.sampled_from(["render", "snapshot"]))
    def call_before_the_first_reset(self, name):
        with pytest.raises(ResetNeeded):
            getattr(self.env, name)()

    @precondition(lambda self: self.history and not self.ended)
    @rule(value=st.sampled_from([np.nan, 1.5, -np.inf]))
    def step_out_of_the_box(self, value):
        with pytest.raises(InvalidAction):
            self.env.step(np.full(self.env.action_space.shape, value, np.float32))

    @precondition(lambda self: self.history)
    @rule()
    def snapshot(self):
        self.taken.append((self.env.snapshot(), list(self.history)))

    @precondition(lambda self: self.taken)
    @rule(data=st.data())
    def restore(self, data):
        snapshot, history = data.draw(st.sampled_from(self.taken))
        self.env.restore(snapshot)
        self.history = list(history)

    @precondition(lambda self: self.history)
    @rule()
    def render(self):
        assert self.env.render().shape == (540, 960, 3)

    @rule()
    def close(self):
        self.env.close()

    @rule(how=st.sampled_from([copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]))
    def copy(self, how):
        self.env.close()
        self.env = how(self.env)

    def teardown(self):
        if not getattr(self, "history", None):
            return
        self.env.close()
        for name, args, kwargs, given in self.history:
            assert equal(getattr(self.twin, name)(*args, **kwargs), given)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", [SledLaunch, SledDescent])
def test_no_order_of_calls_breaks_an_environment(kind, solver):
    machine = type("Machine", (Session,), {"kind": kind, "solver": solver})
    run_state_machine_as_test(machine, settings=settings(max_examples=12, stateful_step_count=20, deadline=None))
