"""Pictures and films of a descent: what stands where, that they repeat, and that no descent is too ugly to draw."""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import pygame
import pytest
from PIL import Image

from sledenv.envs.canvas import HEAVY, SHELL, SKY, Camera
from sledenv.envs.film import write_film
from sledenv.envs.launch import SledLaunch
from sledenv.envs.render import camera_at, draw_film, draw_frame
from sledenv.kernel.records import Status
from sledenv.plot.grounds import bands
from sledenv.plot.riders import HELMET, TOUCHED
from sledenv.simulation.interpolation import states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import Slope, State, Zone
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import DISC, HILL, ICE, UGLY, run
from tests.plot.outlined import PROFILES, RIDDEN, descent_of, ride_of

PANEL = 470  # first row of the panel in a picture of 960 x 540
LAUNCH = (0.0, 0.5, 0.2, 3.0, 0.0, 0.5)


@pytest.fixture(scope="module")
def descent() -> Descent:
    return run(DISC, ICE, HILL, LAUNCH)


def rgb(colour: str) -> list[int]:
    return list(bytes.fromhex(colour[1:]))


def drawn_in(image: np.ndarray, *colours: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels of these colours above the panel."""
    away = np.min([np.abs(image[:PANEL].astype(int) - rgb(colour)).max(axis=-1) for colour in colours], axis=0)
    rows, columns = np.nonzero(away <= 2)
    return rows, columns


def state_of(descent: Descent, time: float) -> State:
    return State.found(states_at(descent.trajectory, [time])[0].tolist())


def camera_of(descent: Descent, time: float) -> Camera:
    return camera_at(descent, state_of(descent, time))


def is_picture(image: np.ndarray, width: int = 960, height: int = 540) -> bool:
    return image.shape == (height, width, 3) and image.dtype == np.uint8 and image.flags.writeable


def test_a_camera_maps_the_slope_to_scale_and_downhill_to_the_right_and_keeps_digits_far_down() -> None:
    """Oracle: a slope at an angle beta goes L cos(beta) to the right and L sin(beta) down."""
    camera = Camera(1e9, 0.25, 0.15, 50.0, 960, 486)
    for away, (right, up) in (((1.0, 0.0), (math.cos(0.15), -math.sin(0.15))), ((0.0, 1.0), (0.15, math.cos(0.15)))):
        expected = [480.0 + 50.0 * right, 243.0 - 50.0 * up]
        assert camera.pixels(np.array([1e9 + away[0], 0.25 + away[1]])) == pytest.approx(expected, abs=0.05)


def test_any_body_is_drawn_where_it_is() -> None:
    """Oracles: the support heights of the body turned by the slope, up, down, left and right."""
    descent = descent_of("boulder", "rigid")
    for time in (0.0, 0.9 * descent.time, descent.time):  # in flight
        x, y, phi = state_of(descent, time)[:3]
        camera = camera_of(descent, time)
        rows, columns = drawn_in(draw_frame(descent, time), HEAVY, SHELL)
        column, row = camera.pixels(np.array([x, y])).tolist()
        down, left, up, right = (
            camera.scale * support_height(descent.body, phi - descent.slope.angle + turn * math.pi / 2)
            for turn in range(4)
        )
        assert [columns.min(), columns.max()] == pytest.approx([column - left, column + right], abs=4.0)
        assert [rows.min(), rows.max()] == pytest.approx([row - up, row + down], abs=4.0)


def test_a_sled_shows_its_rider_and_the_part_that_touches() -> None:
    """Oracle: the colours of the pieces, where the camera projects the head; the log of the descent."""
    descent = descent_of("ridden", "compliant")
    head = max((arc for arc in RIDDEN.arcs if arc.part == "rider"), key=lambda arc: arc.x)
    x, y, phi = descent.launch[:3]
    image, turn = draw_frame(descent, 0.0), np.array([(math.cos(phi), math.sin(phi)), (-math.sin(phi), math.cos(phi))])
    place = np.array([x, y]) + np.array([head.x, head.y]) @ turn
    column, row = camera_of(descent, 0.0).pixels(place).round().astype(int)
    assert image[row, column].tolist() == pytest.approx(rgb(HELMET), abs=2)
    assert len(drawn_in(image, TOUCHED)[0]) == 0
    first = descent.rebounds[0]
    assert RIDDEN.parts[first["feature"] - 1] == "rider"
    image = draw_frame(descent, float(first["t"] - 0.5 * first["duration"]))
    assert len(drawn_in(image, TOUCHED)[0]) > 50
    assert len(drawn_in(image, HELMET)[0]) == 0


def test_zones_are_bands_below_the_surface() -> None:
    """Oracle: the camera, and the colours of the bands; a slope without zones has none of them."""
    zoned = Slope(0.15, 10.0, zones=(Zone(0.5, 1.5, 0.01, 0.0), Zone(2.0, math.inf, 0.6, 0.02)))
    descent, plain = (run(DISC, ICE, slope, LAUNCH) for slope in (zoned, HILL))
    camera, image = camera_of(descent, 0.4), draw_frame(descent, 0.4)
    for band, x in zip(bands(zoned, ICE.friction), (1.0, 2.5), strict=True):
        column, row = camera.pixels(np.array([x, -5.0 / camera.scale])).round().astype(int)
        assert image[row, column].tolist() == pytest.approx(rgb(band.colour), abs=2)
        rows, columns = drawn_in(image, band.colour)
        assert np.quantile(columns, 0.02) > camera.pixels(np.array([band.begin, 0.0]))[0] - 8.0
        assert len(rows) > 500
        assert len(drawn_in(draw_frame(plain, 0.4), band.colour)[0]) < 100


@pytest.mark.parametrize("name", PROFILES)
def test_the_ground_is_drawn_as_it_is_and_stays_in_sight(name: str) -> None:
    """Oracle: the heights of the slope where the camera has them: sky just above, ground or a zone just below.

    Body and path hide some of it.
    """
    ride = ride_of(name)
    for time in np.linspace(0.0, ride.time, 4).tolist():
        camera, image = camera_of(ride, time), draw_frame(ride, time)
        x = camera.x + np.linspace(-0.5, 0.5, 400) * camera.width / camera.scale
        places = camera.pixels(np.stack([x, ride.slope.height_at(x)], axis=-1)).round().astype(int)
        columns, rows = places[((places > 4) & (places < (camera.width - 4, camera.height - 4))).all(axis=1)].T
        assert len(rows) > 100
        above, below = ((image[rows + away, columns] == rgb(SKY)).all(axis=-1).mean() for away in (-4, 4))
        assert above > 0.4
        assert below < 0.02


def test_the_camera_follows_the_body_gently() -> None:
    """Oracles: the place of the body in the picture; the way of the body between two pictures."""
    ride = ride_of("rock")
    times = np.arange(0.0, ride.time, 1.0 / 30.0)
    cameras = [camera_of(ride, time) for time in times.tolist()]
    states = states_at(ride.trajectory, times)
    for camera, (x, y) in zip(cameras, states[:, :2].tolist(), strict=True):
        column, row = camera.pixels(np.array([x, y])).tolist()
        assert column == pytest.approx(480.0, abs=0.3 * camera.height)
        assert 0.15 * camera.height < row < 0.85 * camera.height
    moves = np.abs(np.diff([camera.y for camera in cameras]))
    assert moves.max() < np.abs(np.diff(states[:, 1])).max() + 1.0 / cameras[0].scale


def test_the_panel_tells_the_outcome_at_the_end_alone(descent: Descent) -> None:
    """Oracle: half of the progress is earned on the way, the rest at the finish; six cells of equal width."""
    before, end = (draw_frame(descent, time)[PANEL:] for time in (descent.time - 1e-9, descent.time))
    other = draw_frame(replace(descent, status=Status.TIMEOUT), descent.time)[PANEL:]
    assert (before[:, :640] == end[:, :640]).all()  # the motion
    assert (before[:, 640:800] != end[:, 640:800]).any()  # the reward
    assert (before[:, 800:] != end[:, 800:]).any()  # the status
    assert (other[:, 640:800] == end[:, 640:800]).all()
    assert (other[:, 800:] != end[:, 800:]).any()


@pytest.mark.parametrize("name", UGLY)
def test_ugly_descents_are_drawn(name: str) -> None:
    body, law, slope, launch, options = UGLY[name]
    descent = run(body, law, slope, launch, **options)
    images = [draw_frame(descent, share * descent.time) for share in (0.0, 0.4, 1.0)]
    assert all(map(is_picture, images))
    if body.size > 0.0 and name not in ("overflow", "rod"):  # whose lines hide it
        assert all(len(drawn_in(image, HEAVY)[0]) > 100 for image in images)


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_the_films_of_hops_are_the_film_of_the_descent_at_its_own_rate(solver: Literal["compliant", "rigid"]) -> None:
    """Oracle: pictures at equal times, and the last one for a second."""
    launch, small = State(0.0, 1.2, 0.2, 3.0, 0.0, 0.5), partial(draw_film, size=(160, 90))
    whole = simulate(DISC, ICE, HILL, launch, solver=solver, record="trajectory")
    ride = Ride(DISC, ICE, HILL, launch, Settings(solver=solver), record="trajectory")
    seen = -1.0
    hops: list[np.ndarray] = []
    while ride.status == Status.RUNNING:
        ride.hop()
        hops += small(ride.descent(), after=seen)
        seen = ride.time
    expected = [draw_frame(whole, i / 30.0, (160, 90)) for i in range(math.floor(30.0 * whole.time) + 1)]
    expected += [draw_frame(whole, whole.time, (160, 90))] * 30
    assert len(expected) > 60
    assert np.array_equal(hops, expected)
    assert list(small(whole, after=whole.time)) == []


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> SledLaunch:
    """An environment whose window shows what it draws at once."""
    monkeypatch.setattr(pygame.time, "wait", lambda milliseconds: None)
    return SledLaunch("paper_impact", render_mode="human")


def test_a_window_plays_the_film_until_it_is_closed(shown: SledLaunch) -> None:
    """Oracle: the last picture of the film of a twin that is not shown."""
    twin = SledLaunch("paper_impact")
    for env in (shown, twin):
        env.reset(seed=0)
        env.step(np.zeros(2, np.float32))
    *_, last = twin.film()
    window = pygame.display.get_surface()
    assert window is not None
    picture = np.frombuffer(pygame.image.tobytes(window, "RGB"), np.uint8).reshape(last.shape)
    assert np.array_equal(picture, last)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    shown.reset()
    assert not pygame.display.get_init()
    shown.reset()
    assert not pygame.display.get_init()
    shown.close()
    shown.reset()
    assert pygame.display.get_window_size() == (960, 540)
    shown.close()
    assert not pygame.display.get_init()


def test_whoever_closes_the_window_of_the_process_ends_no_other_environment(shown: SledLaunch) -> None:
    """As reported in https://github.com/Farama-Foundation/MOMAland/pull/78: pygame has one window for all."""
    other = SledLaunch("paper_impact", render_mode="human")
    for close in (other.close, pygame.display.quit, pygame.quit):
        other.reset()
        shown.reset()
        close()
        shown.reset()
        assert pygame.display.get_window_size() == (960, 540)


def test_an_environment_with_an_open_window_can_be_pickled(shown: SledLaunch) -> None:
    """As reported in https://github.com/eleurent/rl-agents/issues/84: what searches for plans copies environments."""
    shown.reset(seed=0)
    again = pickle.loads(pickle.dumps(shown))
    assert again.step(np.zeros(2, np.float32))[1] == shown.step(np.zeros(2, np.float32))[1]
    shown.close()


def test_wrong_arguments_are_named(descent: Descent) -> None:
    with pytest.raises(ValueError, match=r"size = \(100, 90\): must be at least 160 x 90 px"):
        draw_frame(descent, 0.0, (100, 90))
    with pytest.raises(ValueError, match='record="trajectory"'):
        draw_frame(simulate(DISC, ICE, HILL, descent.launch), 0.0)


def test_a_missing_pygame_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pygame", "sledenv.envs.canvas", "sledenv.envs.render"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "sledenv.envs.canvas")
    monkeypatch.delitem(sys.modules, "sledenv.envs.render")
    env = SledLaunch("paper_impact", render_mode="rgb_array")
    env.reset(seed=0)
    with pytest.raises(ImportError, match=r"sledenv\[render\]"):
        env.render()


def test_a_film_is_written_picture_by_picture(tmp_path: Path) -> None:
    """Oracle: number, size and time of the pictures in the file; no picture but the one at hand is drawn."""
    drawn = 0

    def pictures() -> Iterator[np.ndarray]:
        nonlocal drawn
        for shade in range(0, 200, 10):
            drawn += 1
            yield np.full((90, 160, 3), shade, np.uint8)

    file = tmp_path / "film.webp"
    write_film(pictures(), file, fps=10)
    assert drawn == 20
    assert list(tmp_path.iterdir()) == [file]
    with Image.open(file) as film:
        assert getattr(film, "n_frames", 1) == 20
        assert (film.size, film.info["loop"]) == ((160, 90), 0)
        film.load()
        assert film.info["duration"] == 100


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"path": "film.avi"}, r"film.avi'?: must end in .webp"),
        ({"fps": 0}, "fps = 0: must be an integer >= 1"),
        ({"fps": True}, "fps = True: must be an integer >= 1"),
        ({"pictures": []}, "pictures: there is none"),
    ],
)
def test_what_is_no_film_is_named(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    own = {"pictures": [np.zeros((90, 160, 3), np.uint8)], "path": "film.webp"} | given
    with pytest.raises(ValueError, match=message):
        write_film(**own | {"path": tmp_path / own["path"]})
    assert list(tmp_path.iterdir()) == []


def test_pictures_go_on_after_an_episode_that_was_cut_short() -> None:
    """As reported in https://github.com/Farama-Foundation/Gymnasium-Robotics/issues/103, of black ones after the first.

    Oracle: the picture of the same start in an environment that was made for it.
    """
    once, cut = (gym.make("sledenv/SledDescent-v0", render_mode="rgb_array", max_episode_steps=1) for _ in range(2))
    cut.reset(seed=3)
    assert cut.step(np.zeros(1, np.float32))[3]
    for env in (once, cut):
        env.reset(seed=4)
    assert np.array_equal(once.render(), cut.render())
    assert np.ptp(once.render()) > 0
