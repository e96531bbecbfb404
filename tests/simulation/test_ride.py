"""A ride is the descent, hop by hop: bit for bit without trims, and with a ledger that closes with them."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from sledenv import (
    Body,
    ContactLaw,
    Ride,
    Settings,
    Slope,
    State,
    Status,
    load_scenario,
    polygon,
    segment,
    simulate,
    sled,
)
from sledenv.kernel.records import RUNNING
from sledenv.simulation import RideBatch
from sledenv.simulation.support import support_height
from tests.own_scenarios import own_scenario

SOLVERS = ("compliant", "rigid")
ROTOR = 3.0  # kg m^2


def problem(name: str, seed: int) -> tuple:
    """Body, law, slope and launch of a random context with a random launch."""
    rng = np.random.default_rng(seed)
    scenario = load_scenario(name)
    context = scenario.sample(rng)._replace(shape=0.0)  # all of one body
    return tuple(scenario.given(context, rng.uniform(-math.pi, math.pi), rng.uniform(-8.0, 8.0)))


def assert_same(one, other) -> None:
    assert one.outcome == other.outcome
    assert one.status == other.status
    assert one.energy == other.energy
    assert np.array_equal(one.rebounds, other.rebounds)
    assert np.array_equal(one.trajectory, other.trajectory)


@pytest.mark.parametrize(
    ("name", "solver", "record"),
    [
        *((own_scenario("brake_mat"), "compliant", "rebounds"), (own_scenario("brake_mat"), "rigid", "trajectory")),
        *((own_scenario("ice_drop"), "compliant", "trajectory"), (own_scenario("ice_drop"), "rigid", "rebounds")),
    ],
)
def test_a_ride_without_trims_is_the_descent_bit_for_bit_whatever_it_is_interrupted_by(name, solver, record):
    """Oracle: simulate(); copies and pickles are made at random rebounds, and trimming a copy changes nothing."""
    rng = np.random.default_rng(0)
    for seed in range(8):
        settings = Settings(solver, sample_interval=0.001, max_rebounds=60)
        whole = simulate(*problem(name, seed), settings, record=record)
        ride = Ride(*problem(name, seed), settings, record=record, rotor_inertia=ROTOR)
        while ride.status == Status.RUNNING:
            if rng.random() < 0.5:
                other = ride.copy()
                other.trim(rng.uniform(-2.0, 2.0))
                other.hop()
            ride = pickle.loads(pickle.dumps(ride)) if rng.random() < 0.5 else ride.copy()
            ride.hop()
        assert_same(ride.run(), whole)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", [own_scenario("brake_mat"), own_scenario("ice_drop")])
def test_the_ledger_of_a_trimmed_descent_closes_at_every_rebound(name, solver):
    """Oracle: conservation of energy with the rotor's in it, and that of the angular momentum that a trim exchanges."""
    rng, trimmed = np.random.default_rng(1), 0
    for seed in range(12):
        ride = Ride(*problem(name, seed), Settings(solver=solver, max_rebounds=200), rotor_inertia=ROTOR)
        ride.hop()
        while ride.status == Status.RUNNING:
            before, held, energy, spin = ride.state, ride.trim_spin, ride.descent().energy, rng.uniform(-2.0, 2.0)
            ride.trim(spin)
            after, ledger = ride.state, ride.descent().energy
            trimmed += 1
            assert after[:5] == before[:5]
            assert after.omega - before.omega == pytest.approx(spin - held, abs=1e-12)
            rotor = -ride.body.inertia * spin / ROTOR  # its angular velocity, by conservation of angular momentum
            assert ledger.rotor == pytest.approx(0.5 * ROTOR * rotor**2, rel=1e-12)
            gained = 0.5 * ride.body.inertia * (after.omega**2 - before.omega**2) + ledger.rotor - energy.rotor
            work, absorbed = ledger.work - energy.work, ledger.absorbed - energy.absorbed
            assert work - absorbed == pytest.approx(gained, rel=1e-9, abs=1e-9)
            assert min(work, absorbed) == 0.0
            assert ledger.supplied - ledger.work == pytest.approx(energy.supplied - energy.work, rel=1e-14)
            ride.hop()
            ledger = ride.descent().energy
            assert abs(ledger.residual) <= 1e-12 * ledger.turnover
        kept = 0.5 * ride.body.mass * ride.state.u**2
        assert kept <= ride.descent().energy.supplied * (1.0 + 1e-12)
    assert trimmed > 20


def test_spin_that_is_lent_and_given_back_costs_its_work_and_returns_the_spin():
    """Oracle: by hand. Lending s costs J s (omega + s/2) + (J s)^2 / (2 Jr); giving it back absorbs the same."""
    body, law, slope, _ = problem(own_scenario("brake_mat"), 0)
    ride = Ride(body, law, slope, State(0.0, 3.0, 0.0, 1.0, 0.0, 0.5), rotor_inertia=ROTOR)
    ride.trim(2.0)
    assert ride.state.omega == 2.5
    assert ride.trim_spin == 2.0
    work = body.inertia * 2.0 * 1.5 + (body.inertia * 2.0) ** 2 / (2.0 * ROTOR)
    assert ride.descent().energy.work == pytest.approx(work, rel=1e-14)
    ride.trim(0.0)
    ledger = ride.descent().energy
    assert ride.state.omega == 0.5
    assert ledger.rotor == 0.0
    assert ledger.absorbed == pytest.approx(work, rel=1e-14)
    assert ledger.work == pytest.approx(work, rel=1e-14)


def test_a_descent_under_way_is_a_snapshot_that_later_hops_do_not_change():
    ride = Ride(*problem(own_scenario("ice_drop"), 1), record="trajectory", rotor_inertia=ROTOR)
    ride.hop()
    descent = ride.descent()
    kept = descent.outcome.copy(), descent.rebounds.copy(), descent.trajectory.copy()
    assert descent.status == Status.RUNNING
    assert len(descent.rebounds) == 1
    assert descent.trajectory["t"][-1] == descent.time == ride.time
    assert descent.state == ride.state
    assert (np.diff(descent.trajectory["t"]) >= 0.0).all()
    ride.trim(1.0)
    ride.run()
    assert (descent.outcome, *descent.rebounds) == (kept[0], *kept[1])
    assert np.array_equal(descent.trajectory, kept[2])


def columns(problems: list[tuple]) -> list[list]:
    """Laws, slopes and launches of problems that share a body."""
    return [list(column) for column in zip(*problems, strict=True)][1:]


def batch(problems: list[tuple], **options) -> RideBatch:
    return RideBatch(problems[0][0], *columns(problems), **options)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", ["brake_mat", "boulders"])  # the contacts of a disc are followed abreast
def test_a_batch_of_rides_is_its_rides_and_leaves_ended_lanes_alone(name, solver):
    """Oracle: Ride, lane by lane; each is a descent without trims."""
    problems = [problem(own_scenario(name), seed) for seed in range(40)]
    settings, trims = Settings(solver, max_rebounds=50), np.random.default_rng(0).uniform(-2.0, 2.0, (50, 40))
    rides = batch(problems, settings=settings, keep_rebounds=True, rotor_inertia=ROTOR)
    singles = [Ride(*given, settings, rotor_inertia=ROTOR) for given in problems]
    for spins in trims:
        ended = np.flatnonzero(rides.outcomes()["status"] != RUNNING)
        kept = rides.outcomes(ended)
        rides.hop(spins)
        assert np.array_equal(rides.outcomes(ended), kept)
        for ride, spin in zip(singles, spins, strict=True):
            if ride.status == Status.RUNNING:
                ride.trim(spin)
                ride.hop()
    found, whole = rides.descents(), [ride.descent() for ride in singles]
    assert np.array_equal(found.outcomes, [descent.outcome for descent in whole])
    assert found.jam.reward.tolist() == [float(descent.jam.reward) for descent in whole]
    for descent, log in zip(whole, found.rebounds, strict=True):
        assert np.array_equal(descent.rebounds, log[: len(descent.rebounds)])


@pytest.mark.parametrize("shared", [True, False])
def test_branches_are_rides_of_their_own(shared):
    """Oracle: the batch itself, and rides with the same trims."""
    problems = lifted([BODIES[0]] * 3 if shared else BODIES, range(3))
    rides = RideBatch([body for body, *_ in problems], *columns(problems), keep_rebounds=True, rotor_inertia=ROTOR)
    rides.hop(np.full(3, 0.2))
    before, chosen, trims = rides.outcomes(), np.array([2, 1, 1, 0]), np.array([0.1, -0.4, 0.4, 0.0])
    branches = rides.take(chosen)
    branches.hop(trims)
    for i, lane in enumerate(chosen):
        alone = Ride(*problems[lane], rotor_inertia=ROTOR)
        for trim in (0.2, trims[i]):
            alone.trim(trim)
            alone.hop()
        assert branches.outcomes()[i] == alone.descent().outcome
        assert np.array_equal(branches.descents().rebounds[i][:2], alone.descent().rebounds)
    branches.launch(np.array([0]), *(column[:1] for column in columns(problems)))
    assert np.array_equal(rides.outcomes(), before)


BODIES = (
    load_scenario(own_scenario("ice_drop")).all_bodies()[0],
    polygon(40.0, [(-0.6, 0.0), (0.6, 0.0), (0.3, 0.4), (-0.4, 0.3)]),
    segment(90.0, 0.5, 0.1, 9.0),
)


def lifted(bodies, seeds) -> list[tuple]:
    """Problems of several bodies, all launched from a height at which none touches."""
    problems = [problem(own_scenario("ice_drop"), seed) for seed in seeds]
    return [
        (body, law, slope, launch._replace(y=2.0))
        for body, (_, law, slope, launch) in zip(bodies, problems, strict=True)
    ]


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("lanes", [1, 9])
def test_lanes_have_bodies_of_their_own_and_get_others_with_a_launch(shared, lanes):
    """Oracle: rides of their own; what was given is left alone."""
    own = [BODIES[0]] * lanes if shared else [BODIES[i % 3] for i in range(lanes)]
    problems = lifted(own, range(lanes))
    given = BODIES[0] if shared else np.concatenate([body.record for body in own])
    kept = None if shared else given.copy()
    rides = RideBatch(given, *columns(problems), rotor_inertia=ROTOR)
    for step in range(6):
        rides.hop(np.zeros(lanes))
        new = np.arange(0, lanes, 2)
        if step == 2:  # as they were
            again = lifted([problems[i][0] for i in new], new + 50)
            rides.launch(new, *columns(again))
        if step == 3:  # with others
            again = lifted([BODIES[(i + 1) % 3] for i in new], new + 70)
            rides.launch(new, *columns(again), [body for body, *_ in again])
        if step in (2, 3):
            for i, one in zip(new.tolist(), again, strict=True):
                problems[i] = one
            rides = pickle.loads(pickle.dumps(rides))
    while (rides.outcomes()["status"] == RUNNING).any():
        rides.hop(np.zeros(lanes))
    found = rides.descents()
    for i, one in enumerate(problems):
        alone = simulate(*one)
        assert found.outcomes[i] == alone.outcome
        assert found.jam.reward[i] == rides.descents(np.array([i])).jam.reward[0] == alone.jam.reward
    assert shared or np.array_equal(given, kept)


def test_misuse_of_a_batch_leaves_it_as_it_is():
    """Oracle: a batch that was not misused; other messages are those of the table of wrong inputs."""
    body, law, slope, launch = lifted(BODIES[:1], [0])[0]
    settings, launches = Settings(end_touching="nose"), [launch] * 3
    rides, twin = (RideBatch(body, law, slope, launches, settings, rotor_inertia=ROTOR) for _ in range(2))
    moved = Body(body.mass, body.inertia, body.arcs)  # whose first part is its nose
    for call in (
        lambda: rides.hop(np.array([0.0, np.nan, 0.0])),
        lambda: rides.launch(np.array([1, 1]), law, slope, launches[:2]),
        lambda: rides.launch(np.arange(2), law, slope, [launch, launch._replace(y=0.0)]),
        lambda: rides.launch(np.arange(1), law, slope, launches[:1], BODIES[1]),  # of other parts
        lambda: rides.launch(np.arange(1), law, slope, launches[:1], moved),  # or of others at their places
        lambda: RideBatch(body, law, slope, launches).hop(np.ones(3)),  # without a rotor
        lambda: rides.outcomes([5]),
        lambda: rides.descents([5]),
        lambda: rides.take(np.array([3])),
    ):
        with pytest.raises((ValueError, IndexError), match=r"no rotor|must be|must have|no two|below the surface"):
            call()
    for each in (rides, twin):
        each.hop(np.zeros(3))
    assert np.array_equal(rides.outcomes(), twin.outcomes())


SHORTEST = 0.1  # [s]
BUMPS = [(1.0, 0.0), (4.0, 0.3), (5.0, 0.3), (8.0, 0.0), (9.0, 0.0), (12.0, 0.4), (12.5, 0.4), (16.0, 0.0)]


def on_bumps(seed: int) -> tuple:
    """A sled with its rider on bumps, thrown or started on the ground: it lands on nose and tail in turn."""
    rng = np.random.default_rng([9, seed])
    law = ContactLaw.from_restitution(rng.uniform(0.1, 0.4), stiffness=1e7, friction=0.02, rolling_arm=0.001)
    body, slope = sled(), Slope(0.15, 20.0, profile=BUMPS)
    drop, phi = rng.choice([0.0, 0.3]), rng.uniform(-0.1, 0.1)
    start = State(0.0, support_height(body, phi) + drop, phi, rng.uniform(6.0, 9.0), 0.0, rng.uniform(-0.5, 0.5))
    return body, law, slope, start


def looked_ahead(ride: Ride) -> Ride:
    """Go on to where a flight begins that lasts long enough, found by flying it; behind the slope to the end."""
    while ride.status == Status.RUNNING:
        there = ride.copy()
        there.hop()
        logged, ahead = ride.descent(), there.descent()
        ends = ahead.rebounds["t_touchdown"][-1] if len(ahead.rebounds) > len(logged.rebounds) else there.time
        if ends - ride.time >= SHORTEST and ride.descent().outcome["t_line"] == math.inf:
            break
        ride = there
    return ride


@pytest.mark.parametrize(("seed", "record"), [(0, "rebounds"), (1, "trajectory"), (2, "rebounds"), (3, "trajectory")])
def test_a_hop_goes_on_through_short_flights(seed: int, record: str) -> None:
    """Oracle: every hop by itself, and looking ahead with copies; trims in the long flights alone."""
    settings, given = Settings(run_out=2.0), on_bumps(seed)
    options = {"record": record, "rotor_inertia": ROTOR}
    ride, plain = Ride(*given, settings, shortest_flight=SHORTEST, **options), Ride(*given, settings, **options)
    ride.await_flight()
    plain = looked_ahead(plain)
    spins = np.random.default_rng(seed).uniform(-0.5, 0.5, 100).tolist()
    decided = 0
    while ride.status == Status.RUNNING:
        assert_same(ride.descent(), plain.descent())
        ride.await_flight()  # which is here
        ride.trim(spins[decided])
        plain.trim(spins[decided])
        ride.hop()
        plain.hop()
        plain = looked_ahead(plain)
        decided += 1
    assert 1 <= decided < len(ride.descent().rebounds)
    assert_same(ride.descent(), plain.descent())
