"""Commands of scenarios and of one descent: simulate, sensitivity, scenarios, replay, play."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

from cyclopts import Parameter

from sledenv.command.arguments import (
    Count,
    File,
    Folder,
    Json,
    ScenarioName,
    Seed,
    Solver,
    Surfaces,
    within,
)
from sledenv.command.running import DPI, taken, tell, working

if TYPE_CHECKING:
    from sledenv.scenarios.scenario import Scenario
    from sledenv.simulation.bodies import Body
    from sledenv.simulation.outcomes import Descent, Record
    from sledenv.simulation.scene import ContactLaw, Slope, State
    from sledenv.simulation.settings import Settings

PICTURES: Final = ("strobe.png", "series.png")
_HILLS: Final = 3  # contexts of a page to ride


@Parameter(name="*")
@dataclass(frozen=True)
class Launch:
    """Which launch of a scenario is meant.

    Parameters
    ----------
    seed
        Which context of the scenario is drawn.
    orientation_deg
        Launch orientation instead of the drawn one.
    spin
        Launch spin [rad/s] instead of the drawn one.
    speed
        Launch speed [m/s] instead of the drawn one.
    """

    seed: Seed = 0
    orientation_deg: Annotated[float | None, Parameter(metavar="DEG"), within(360.0)] = None
    spin: Annotated[float | None, Parameter(metavar="RAD_S"), within(1e6)] = None
    speed: Annotated[float | None, Parameter(metavar="M_S"), within(1e6)] = None


_DRAWN = Launch()


def simulate(
    scenario: ScenarioName,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[Solver, Surfaces] = "compliant",
    out: Folder | None = None,
    csv: File | None = None,
    rebounds_csv: File | None = None,
    json: Json = False,
) -> None:
    """Simulate one descent of a scenario.

    Prints what was simulated, the rebounds, how it ended, jam metrics and energy ledger. Positions and velocities are
    those of the mass centre, in the frame of the slope, a profile's plane: x downhill, y along the outward normal,
    angles counter-clockwise.

    A rebound is a contact, short or long: t and x are those of its end, velocities those before and after. grip is the
    impulse of friction over the most that it could be, loss the share of u that is gone, 0 where u has grown. A last
    contact in which the descent ends is there as well.

    Parameters
    ----------
    out
        Write strobe.png and series.png into this folder.
    csv
        Write the trajectory as this table, units in the header; a file that ends in .parquet is one. It and that of
        the rebounds can be given to identify.
    rebounds_csv
        Write the rebounds as another table.
    """
    from sledenv.machine.files import publish, replacing, write_table
    from sledenv.pages.as_json import plain_descent
    from sledenv.pages.columns import rebound_columns, trajectory_columns
    from sledenv.simulation.words import story

    asked_for = {"--csv": (csv, trajectory_columns), "--rebounds-csv": (rebounds_csv, rebound_columns)}
    for option, (file, _) in asked_for.items():
        if out is not None and file is not None and file.parent.resolve() == out.resolve():
            raise ValueError(f"{option} = {file}: must lie outside {out}, which --out replaces as a whole")
    with ExitStack() as places:  # taken before anything is simulated
        tables = [
            (file, columns_of, taken(places, option, replacing(file, ".csv", ".parquet")))
            for option, (file, columns_of) in asked_for.items()
            if file
        ]
        folder = out and taken(places, "--out", publish(out, PICTURES))
        asked = _asked(scenario, launch, solver)
        descent = _descend(asked, "trajectory" if csv or folder else "rebounds")
        lines = [asked.title, story(descent)]
        for file, columns_of, place in tables:
            columns = columns_of(descent)
            write_table(place, columns, parquet=file.suffix.lower() == ".parquet")
            count = len(next(iter(columns.values())))
            lines.append(f"simulate: wrote {count} rows into {file}\n  columns {', '.join(columns)}")
        if folder:
            _draw(descent, folder, asked.title)
    if folder:
        lines.append(f"simulate: wrote {' and '.join(PICTURES)} into {out}")
    written = [file for file in (csv, rebounds_csv, *(out / name for name in PICTURES if out)) if file]
    tell("\n".join(lines), asked.named | plain_descent(descent) | {"written": written}, json)


def sensitivity(
    scenario: ScenarioName,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[Solver, Surfaces] = "compliant",
    rebounds: Count = 10,
    out: File | None = None,
    json: Json = False,
) -> None:
    """Differentiate one descent of a scenario.

    Prints the derivatives of how a descent ends by launch, law, slope and body, with the change of each from which on
    its events are others; and how small differences grow, rebound by rebound.

    Parameters
    ----------
    rebounds
        At most so many.
    out
        Draw the growth of differences into this picture.
    """
    from sledenv.machine.files import replacing
    from sledenv.pages.as_json import plain_sensitivity, plain_setting
    from sledenv.simulation.sensitivity import sensitivity as differentiate
    from sledenv.simulation.words import sensitivity_table, setting

    with ExitStack() as places:
        picture = out and taken(places, "--out", replacing(out, ".png"))
        asked = _asked(scenario, launch, solver)
        with working("sensitivity"):
            found = differentiate(*asked.given, asked.settings, rebounds=rebounds)
        if picture:
            from sledenv.plot import plot_growth

            plot_growth(found).savefig(picture, dpi=DPI, format="png")
    lines = [asked.title, setting(*asked.given), "", sensitivity_table(found)]
    lines += [f"sensitivity: wrote {out}"] if out else []
    data = asked.named | plain_setting(*asked.given) | plain_sensitivity(found)
    tell("\n".join(lines), data | {"written": [out] if out else []}, json)


def scenarios(*, json: Json = False) -> None:
    """List the shipped scenarios: name, what an agent chooses, and what is asked."""
    from sledenv.envs.task import TRIM
    from sledenv.machine.text_tables import fitted
    from sledenv.scenarios.scenario import load_scenario, scenario_names
    from sledenv.scenarios.sections import control_words

    shipped = [load_scenario(name) for name in scenario_names()]
    chosen = [(TRIM,) if one.is_ride else control_words(one.control_bounds)[one.control.chosen] for one in shipped]
    cells = [(one.id, ", ".join(controls), one.question) for one, controls in zip(shipped, chosen, strict=True)]
    data = [
        {"name": one.id, "agent_chooses": controls, "question": one.question}
        for one, controls in zip(shipped, chosen, strict=True)
    ]
    tell(fitted(("name", "agent chooses", "what is asked"), cells, words=3), data, json)


def replay(
    scenario: ScenarioName,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[Solver, Surfaces] = "compliant",
    out: File = Path("replay.html"),
    json: Json = False,
) -> None:
    """Write a page that replays one descent of a scenario.

    The page works in any browser, offline: the sled with its contact force, time series, rebound table.

    Parameters
    ----------
    out
        The page.
    """
    from sledenv.machine.files import replacing
    from sledenv.pages.replay import replay_page

    with ExitStack() as places:
        page = taken(places, "--out", replacing(out, ".html", ".htm"))
        asked = _asked(scenario, launch, solver)
        page.write_text(replay_page(_descend(asked, "trajectory"), asked.heading), encoding="utf-8")
    tell(f"replay: wrote {out}", asked.named | {"written": [out]}, json)


def play(
    scenario: ScenarioName | None = None,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[Solver, Surfaces] = "compliant",
    runs: Annotated[tuple[Path, ...], Parameter(name="--run", metavar="RUN")] = (),
    tracks: Annotated[bool, Parameter(negative=())] = False,
    html: File = Path("play.html"),
    json: Json = False,
) -> None:
    """Write a page that simulates: body, surface, ground and launch are set there; or one to ride.

    The page works in any browser, offline, and has the kernel itself, so that its numbers are those of Python. It opens
    with the descent of a scenario that simulate prints; without a scenario with a ride over bumps, and the options of a
    launch and the surfaces are none of it.

    If the scenario has a rider and bumps, the page is one to ride: you trim each flight with the arrow keys, beside the
    rides of a rule and of an agent. There are three slopes, that of the seed and of the two behind it.

    Parameters
    ----------
    runs
        Folder of a trained agent that rides beside you, or the name of one that ships; may be repeated (default: those
        that ship for the scenario).
    tracks
        Ride on the tracks made by hand in place of the slopes of the scenario, in the context of the seed.
    html
        The page.
    """
    import numpy as np

    from sledenv.machine.files import replacing
    from sledenv.pages.opening import opening_page
    from sledenv.pages.play import Played, play_page
    from sledenv.scenarios import load_track, track_names
    from sledenv.scenarios.scenario import load_scenario

    if scenario is None and (launch != _DRAWN or solver != "compliant" or runs or tracks):
        raise ValueError(
            "play: a launch, surfaces, a run or tracks are asked for, of no scenario: name one, such as sled_rollers"
        )
    with ExitStack() as places:
        page = taken(places, "--html", replacing(html, ".html", ".htm"))
        if scenario is None:
            page.write_text(opening_page(), encoding="utf-8")
            tell(f"play: wrote {html}", {"written": [html]}, json)
            return
        loaded = load_scenario(scenario)
        ride = loaded.is_ride  # a plane has no take-offs but of rebounds
        if runs and not ride:
            raise ValueError(f"--run = {runs[0]}: scenario {loaded.id} has no rider over bumps, see sledenv map")
        if tracks and not ride:
            raise ValueError(f"--tracks: scenario {loaded.id} has no rider over bumps, who could ride on them")
        if ride and solver != "compliant":
            raise ValueError(f"--solver = {solver!r}: must be compliant in a page to ride")
        loaded = loaded.ride() if ride else loaded
        orientation = None if launch.orientation_deg is None else math.radians(launch.orientation_deg)
        given = {"orientation": orientation, "spin": launch.spin, "speed": launch.speed}
        asked = {name: value for name, value in given.items() if value is not None}
        names = track_names() if tracks else ()
        seeds = [launch.seed] * len(names) or range(launch.seed, launch.seed + (_HILLS if ride else 1))
        contexts = [loaded.sample(np.random.default_rng(seed))._replace(**asked) for seed in seeds]
        if ride:
            from sledenv.benchmark.riders import ridden
            from sledenv.pages.ride import Hill, ride_page

            with working("play"):
                others = ridden(loaded, np.array(contexts), runs, names)
            titles = [load_track(name).title for name in names] or [f"draw {seed}" for seed in seeds]
            grounds: list[Scenario | None] = [*map(loaded.on, names)] or [None] * len(seeds)
            hills = [Hill(*one) for one in zip(titles, contexts, others, grounds, strict=True)]
            text = ride_page(loaded, hills, "Tracks made by hand" if tracks else None)
        else:
            text = play_page(loaded, [Played(f"seed {launch.seed}", contexts[0])], solver)
        page.write_text(text, encoding="utf-8")
    named = {"scenario": loaded.id, "seed": launch.seed, "solver": solver, "written": [html]}
    tell(f"play: wrote {html}", named, json)


class _Asked(NamedTuple):
    """Which descent the arguments mean."""

    named: dict[str, Any]
    words: str  # title of the scenario
    given: tuple[Body, ContactLaw, Slope, State]
    settings: Settings

    @property
    def title(self) -> str:
        """Its name."""
        return "{scenario}, seed {seed}, solver {solver}".format(**self.named)

    @property
    def heading(self) -> str:
        """Its name for a page: whoever opens it may know neither the command nor its options."""
        surfaces = {"compliant": "compliant surfaces", "rigid": "rigid surfaces"}
        return f"{self.words}, draw {self.named['seed']}, {surfaces[self.named['solver']]}"


def _asked(name: str, chosen: Launch, solver: Solver) -> _Asked:
    import numpy as np

    from sledenv.scenarios.scenario import load_scenario

    scenario = load_scenario(name)
    context = scenario.sample(np.random.default_rng(chosen.seed))
    orientation = None if chosen.orientation_deg is None else math.radians(chosen.orientation_deg)
    return _Asked(
        {"scenario": scenario.id, "seed": chosen.seed, "solver": solver},
        scenario.title,
        scenario.given(context, orientation, chosen.spin, chosen.speed),
        scenario.settings(solver),
    )


def _descend(asked: _Asked, record: Record) -> Descent:
    from sledenv.simulation.simulate import simulate

    with working("descent"):
        return simulate(*asked.given, asked.settings, record=record)


def _draw(descent: Descent, folder: Path, title: str) -> None:
    from sledenv.plot import plot_descent, plot_strobe

    plot_strobe(descent, labels=[title]).savefig(folder / PICTURES[0], dpi=DPI)
    plot_descent(descent, label=title).savefig(folder / PICTURES[1], dpi=DPI)
