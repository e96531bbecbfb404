"""SledDescent is a ride: without trims it is SledLaunch bit for bit, and it goes on from any flight in many ways."""

from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from scipy import stats
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID, register
from sledenv.envs.columns import STATE
from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import Task
from sledenv.scenarios.tracks import TRACKS, standard_normals
from sledenv.simulation import STATUS_OF_CODE
from tests.envs.kinds import equal
from tests.own_scenarios import own_scenario, ride_over_bumps

BUMPS, UNSTEADY = ride_over_bumps(), ride_over_bumps(noise_rad_s=0.3)


def name_of(scenario):
    return scenario.id if isinstance(scenario, sledenv.scenarios.Scenario) else str(scenario)


def random_action(env, rng):
    return rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)


def play(env, rng) -> list:
    """Step with random actions to the end of the episode; return all that the steps gave."""
    steps = []
    while not steps or not (steps[-1][2] or steps[-1][3]):
        steps.append(env.step(random_action(env, rng)))
    return steps


@pytest.mark.parametrize("scenario", [own_scenario("ice_fast"), UNSTEADY], ids=name_of)
def test_both_checkers_pass_without_a_warning(scenario):
    """Oracle: Gymnasium's and SB3's check_env; pytest turns warnings into errors."""
    env = gym.make(DESCENT_ID, scenario=scenario)
    check_env(env.unwrapped, skip_render_check=scenario != UNSTEADY)
    check_env_sb3(env.unwrapped)


@pytest.mark.parametrize(
    ("scenario", "solver"),
    [
        (own_scenario("brake_mat"), "compliant"),
        (own_scenario("ice_drop"), "rigid"),
        (own_scenario("ice_fast"), "compliant"),
        (BUMPS, "compliant"),
    ],
    ids=name_of,
)
def test_without_trims_the_return_is_the_reward_of_the_launch_and_the_descent_is_the_same_bit_for_bit(scenario, solver):
    """Oracle: SledLaunch, whose launches are given back as contexts; the last info is the same in every entry."""
    rng = np.random.default_rng(0)
    launch, descent = SledLaunch(scenario, "both", solver=solver), SledDescent(scenario, solver=solver)
    launch.reset(seed=1)
    for _ in range(20 if solver == "compliant" else 5):  # a rigid descent bounces until it settles
        _, begun = launch.reset()
        _, reward, _, _, info = launch.step(random_action(launch, rng))
        chosen = {name: info["launch"][name] for name in ("orientation", "spin")}
        observation, told = descent.reset(seed=0, options={"context": begun["context"] | chosen})
        assert told == {"context": begun["context"] | chosen, "launch": info["launch"]}
        total, ended = 0.0, False
        while not ended:
            observation, part, ended, truncated, last = descent.step(np.zeros(1, np.float32))
            assert descent.observation_space.contains(observation)
            assert not truncated
            total += part
        assert total == pytest.approx(reward, abs=1e-12)
        assert last == info | {"context": told["context"]}


def test_a_launch_is_drawn_from_the_control_bounds_unless_the_scenario_says_from_what():
    """Oracle: the ranges of the files; sled_snow says nothing of the pose at launch."""
    env, asks = SledDescent("sled_snow"), sledenv.load_scenario("sled_snow")
    assert asks.launch_section.orientation_deg is None
    turns = [env.reset(seed=seed)[1]["launch"]["orientation"] for seed in range(60)]
    low, high = np.radians(asks.control.orientation_deg)
    assert low <= min(turns) < 0.8 * low
    assert 0.8 * high < max(turns) <= high
    env = SledDescent(BUMPS)
    launched = [env.reset(seed=seed)[1]["launch"] for seed in range(60)]
    turns, spins = np.array([[launch[name] for launch in launched] for name in ("orientation", "spin")])
    assert 0.8 * np.radians(5.0) < np.abs(turns).max() <= np.radians(5.0)
    assert 0.8 < np.abs(spins).max() <= 1.0
    assert env.action_names == ("trim",)
    with pytest.raises(TypeError, match=r"got an unexpected keyword argument 'control'; it has scenario, render_mode"):
        SledDescent(own_scenario("ice_drop"), control="spin")


@pytest.mark.parametrize("scenario", [own_scenario("brake_mat"), BUMPS, UNSTEADY], ids=name_of)
def test_rewards_are_gains_in_progress_and_the_work_of_the_trims_is_charged(scenario):
    """Oracle: conservation of energy; progress, supply and reward by hand."""
    env = SledDescent(scenario)
    env.reset(seed=3)
    rng = np.random.default_rng(2)
    body, worked, length = env.task.bodies[0], False, env.task.scenario.slope_section.length_m
    for _ in range(12):
        env.reset()
        gained = 0.0
        terminated = False
        while not terminated:
            _, reward, terminated, truncated, info = env.step(random_action(env, rng))
            energy = sledenv.simulation.Energy(**info["descent"]["energy"])
            assert abs(energy.residual) <= 1e-12 * energy.turnover
            worked |= energy.work > 0.0
            jam = info["jam"]
            assert not truncated
            earned = 0.5 * jam["progress"] + (0.5 * np.sqrt(jam["retention"]) if terminated else 0.0)
            assert reward == pytest.approx(earned - gained, abs=1e-12)
            gained = earned
            x = env.episodes.lanes.flights["x"][0]
            assert jam["progress"] == pytest.approx(np.clip(x / length, 0.0, 1.0), abs=1e-12)
        if info["is_success"]:
            outcome = env.episodes.viewers[0].descent()
            assert outcome.jam.retention == jam["retention"]
            drop = outcome.launch.y - body.record["lowest"][0]
            supplied = (
                0.5 * body.mass * (outcome.launch.u**2 + outcome.launch.v**2)
                + 0.5 * body.inertia * outcome.launch.omega**2
                + body.mass * 9.81 * (drop * np.cos(outcome.slope.angle) + length * np.sin(outcome.slope.angle))
                + outcome.energy.work
            )
            assert outcome.energy.supplied == pytest.approx(supplied, rel=1e-12)
    assert worked


def test_the_observation_is_the_state_at_the_beginning_of_the_flight_and_the_ground_around():
    """Oracle: the outcome of the ride, the vertices of its slope; scaled as docs/environments/descent.md says."""
    env = SledDescent(UNSTEADY, columns=("context", "state", "ground"))
    task, scenario = env.task, env.task.scenario
    body = task.bodies[0]
    reach, relief = 2 * (8.0 + 6.0 + 1.5 + 6.0), 0.4
    below = 44.0 * np.sin(np.radians(11.0)) + relief
    speed = np.sqrt(14.0**2 + body.inertia / body.mass + 2.0 * 9.81 * (0.4 + body.size + below))
    spin, lent = speed / body.size, 1.0 + 4.0 * 0.3
    rng, seen = np.random.default_rng(1), 0
    for seed in range(20):
        observation, info = env.reset(seed=seed)
        slope, ended = scenario.given(sledenv.scenarios.Context(**info["context"])).slope, False
        while not ended:
            row = env.episodes.lanes.flights[0]
            ground = np.interp(row["x"], *np.array(slope.profile).T)
            expected = (
                1.0 - row["x"] / 40.0, (row["y"] - ground) / (0.4 * body.size), np.sin(row["phi"]),
                np.cos(row["phi"]), 4.0 * row["u"] / speed, 8.0 * row["v"] / speed, 3.0 * row["omega"] / spin,
                row["trim_spin"] / lent, 4.0 * row["supplied"] / (body.mass * speed**2),
                row["t"] * speed / (3.0 * 40.0), row["rebounds"] / 15.0,
            )  # fmt: skip
            assert len(expected) == len(STATE)
            assert observation[11:22] == pytest.approx(expected, abs=1e-6)
            behind = [vertex for vertex in slope.profile if vertex[0] <= row["x"]][-2:]
            ahead = [vertex for vertex in slope.profile if vertex[0] > row["x"]][:8]
            order = [*range(len(behind), 0, -1), *range(1, 9)]
            told = [
                [8.0 * (x - row["x"]) / (k * reach), (y - ground) / relief, 1.0]
                for k, (x, y) in zip(order, behind + ahead, strict=False)
            ]
            told = [[0.0] * 3] * (2 - len(behind)) + told + [[0.0] * 3] * (8 - len(ahead))
            assert observation[22:] == pytest.approx(np.ravel(told), abs=1e-6)
            seen += 1
            observation, _, ended, _, info = env.step(random_action(env, rng))
    assert seen > 50
    assert len(env.observation_names) == len(set(env.observation_names)) == 52
    assert env.observation_names[22:26] == ("behind_2_x", "behind_2_y", "behind_2_there", "behind_1_x")


def test_planners_are_told_no_more_than_is_seen():
    """Oracle: what is seen, which is the same; the ground of the ride up to the eighth vertex, level behind it."""
    task = Task(UNSTEADY, ride=True, observe=("angle", "restitution"))
    scenes = task.scenario.draw(np.random.default_rng(3).random((20, task.scenario.draws)))
    rides = task.rides(scenes)
    rides.hop(np.full(20, 0.3))
    known = task.masked(rides.scenes, rides.flights)
    assert np.array_equal(task.observe(known, rides.flights), task.observe(rides.scenes, rides.flights))
    low, high = task.scenario.ranges
    assert (known.rows["friction"] == 0.5 * (low[1] + high[1])).all()
    assert known.rows["angle"].tolist() == scenes.rows["angle"].tolist()
    assert not known.rows["stream"].any()
    assert known.launches.tobytes() == scenes.launches.tobytes()  # a ledger of the whole ride begins there
    for told, own, x in zip(known.grounds(), scenes.grounds(), rides.flights["x"], strict=True):
        count = min(len(own), int((own["x"] <= x).sum()) + 8)
        assert count - 1 <= len(told) <= count
        for name in ("x", "y"):
            assert told[name].tolist() == own[name][: len(told)].tolist()
        assert len(told) == count or own["y"][count - 1] == told["y"][-1]
    again = task.masked(known, rides.flights)
    assert again.rows.tobytes() == known.rows.tobytes()
    assert again.pieces.tobytes() == known.pieces.tobytes()


def test_every_decision_is_of_a_flight_that_is_long_enough():
    """Oracle: the log of rebounds without trims, by which a flight could end sooner than before the decision."""
    env, short = SledDescent(BUMPS), 0
    for seed in range(30):
        env.reset(seed=seed)
        begins = [float(env.episodes.lanes.flights["t"][0])]
        ended = False
        while not ended:
            *_, ended, _, info = env.step(np.zeros(1, np.float32))
            begins += [] if ended else [float(env.episodes.lanes.flights["t"][0])]
        log = info["rebounds"]
        starts, ends = [0.0, *log["t"]], [*log["t_touchdown"], info["descent"]["time"]]
        flights = {start: end - start for start, end in zip(starts, ends, strict=True)}
        final = starts[-1]  # in which the descent has ended: nobody knows how long it would have been
        assert [start for start in begins if start != final] == [
            start for start, length in flights.items() if length >= 0.12 and start != final
        ]
        short += sum(0.0 < length < 0.12 for length in flights.values())
    assert short > 30


def test_the_errors_of_an_unsteady_rider_are_normal_and_independent():
    """Oracle: scipy's Kolmogorov-Smirnov test; correlations with neighbours and with the bumps of the same number."""
    numbers = np.arange(20_000, dtype=float)
    first, second = (standard_normals(numbers, np.full(len(numbers), k)) for k in (0, 1))
    for errors in (first, second, standard_normals(np.zeros(20_000), np.arange(20_000))):
        assert stats.kstest(errors, "norm").pvalue > 1e-3
        assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 0.03
    vertices = UNSTEADY._bumps.draw(numbers)
    for other in (second, vertices[:, 0, 0], vertices[:, 1, 0] - vertices[:, 0, 0], vertices[:, 1, 1]):
        assert abs(np.corrcoef(first, other)[0, 1]) < 0.03
        assert abs(np.corrcoef(first**2, other)[0, 1]) < 0.03  # the size of an error is that of one of its two draws
    assert np.isfinite(standard_normals(np.array([0.0, TRACKS - 1.0]), np.full(2, 999_999))).all()


def test_an_unsteady_rider_lends_what_is_asked_for_with_the_error_of_its_context():
    """Oracle: the errors of the scenario, which a search may know; a steady rider has none, one on a plane does."""
    content = sledenv.load_scenario("sled_snow").model_dump(by_alias=True)
    content["rider"]["noise_rad_s"] = 0.2
    rng = np.random.default_rng(0)
    for scenario in (BUMPS, UNSTEADY, sledenv.scenarios.Scenario.model_validate(content)):
        env, asked, lent, k = SledDescent(scenario), [], [], 0
        for seed in range(6):
            _, info = env.reset(seed=seed)
            context, ended, k = np.array([list(info["context"].values())]), False, 0
            while not ended:
                action = random_action(env, rng)
                *_, ended, _, _ = env.step(action)
                error = scenario.errors(context[:, -1], np.array([k]))[0]
                asked.append(scenario.rider.trim_rad_s * float(action[0]) + error)
                lent.append(float(env.episodes.lanes.flights["trim_spin"][0]))
                k += 1
        assert lent == asked
        assert (context[0, -1] > 0.0) == (scenario is BUMPS or scenario.rider.noise_rad_s > 0.0)


@pytest.mark.parametrize("scenario", [own_scenario("ice_drop"), UNSTEADY], ids=name_of)
@given(draws=st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=12, max_size=12), seed=st.integers(0, 99))
def test_a_context_that_is_given_back_repeats_the_ride_bit_for_bit(scenario, draws, seed):
    """Oracle: the ride of the context that was drawn; the film repeats it too."""
    task = Task(scenario, ride=True)
    context = task.scenario.contexts(np.array(draws)[: task.scenario.draws])
    env, other = SledDescent(scenario), SledDescent(scenario)
    one = env.reset(seed=seed, options={"context": context})
    assert one[1]["context"] == dict(zip(sledenv.scenarios.Context._fields, context.tolist(), strict=True))
    steps = play(env, np.random.default_rng(seed))
    assert equal(other.reset(seed=0, options={"context": one[1]["context"]}), one)
    assert equal(play(other, np.random.default_rng(seed)), steps)
    assert all(env.observation_space.contains(step[0]) for step in steps)
    total, last = sum(step[1] for step in steps), steps[-1][4]
    assert total == pytest.approx(0.5 * last["jam"]["progress"] + 0.5 * np.sqrt(last["jam"]["retention"]), abs=1e-12)
    shown = env.episodes.viewers[0].descent()
    assert shown.energy._asdict() == last["descent"]["energy"]
    assert shown.rebounds["t"].tolist() == last["rebounds"]["t"]


def test_limits_end_a_ride_with_the_reward_of_what_was_done():
    """Oracle: the statuses; paper_impact has 0.04 s for its only impact, and no rider."""
    content = sledenv.load_scenario(own_scenario("ice_drop")).model_dump(mode="json", by_alias=True)
    content["limits"]["max_rebounds"] = 2
    few = sledenv.scenarios.Scenario.model_validate(content)
    for scenario, status in (("paper_impact", "timeout"), (few, "log_full")):
        env, ends = SledDescent(scenario), set()
        for seed in range(10):
            env.reset(seed=seed)
            *_, (_, _, *ended, info) = play(env, np.random.default_rng(seed))
            assert ended == [True, False]
            ends.add(STATUS_OF_CODE[info["descent"]["status"]])
        assert status in ends


def test_the_spec_survives_json_and_a_second_registration_is_silent():
    arguments = {"scenario": own_scenario("ice_fast"), "solver": "rigid", "split": "test", "launch_noise": [0.1, 0.0]}
    for name, more in ((LAUNCH_ID, {"control": "orientation+spin"}), (DESCENT_ID, {})):
        env = gym.make(name, **arguments, **more)
        again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
        assert again.unwrapped.task.control == env.unwrapped.task.control
        assert equal(env.reset(seed=2), again.reset(seed=2))
    register()


class Session(RuleBasedStateMachine):
    """Any order of calls: whatever happens, each episode is the one that a plain twin replays from its beginning."""

    kind: type[SledLaunch]
    solver = "compliant"
    scenario = own_scenario("ice_fast")

    @initialize(split=st.sampled_from([None, "train", "test"]), noise=st.sampled_from([(0.0, 0.0), (0.2, 0.5)]))
    def make(self, split, noise):
        arguments = {"scenario": self.scenario, "split": split, "launch_noise": noise, "solver": self.solver}
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
        for name, args, kwargs, gave in self.history:
            assert equal(getattr(self.twin, name)(*args, **kwargs), gave)


@pytest.mark.parametrize(
    ("kind", "solver"), [(SledLaunch, "rigid"), (SledDescent, "compliant"), (SledDescent, "bumps")]
)
def test_no_order_of_calls_breaks_an_environment(kind, solver):
    own = {"scenario": UNSTEADY} if solver == "bumps" else {"solver": solver}
    machine = type("Machine", (Session,), {"kind": kind} | own)
    run_state_machine_as_test(machine, settings=settings(stateful_step_count=20))
