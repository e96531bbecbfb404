"""The command ``sledenv``: descents, what they depend on, laws from recordings, paper, benchmark, installation.

What a sub-command needs is imported where it runs, so that help is quick and completion too.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple

from cyclopts import CoercionError, Group, Parameter, Token
from cyclopts.completion import CompletionContext

from sledenv.command.running import FAILED, Count, Seed, Seeds, app, positive, progress, run, tell, within, working

if TYPE_CHECKING:
    import pandas as pd

    from sledenv.simulation.bodies import Body
    from sledenv.simulation.outcomes import Descent, Record
    from sledenv.simulation.scene import ContactLaw, Slope, State
    from sledenv.simulation.settings import Settings

PICTURES: Final = ("strobe.png", "series.png")
_DPI = 150

command = app("sledenv", "Sled descents as repeated oblique impacts.")
command.register_install_completion_command(help="Install the completion of words in this shell.")

Solver = Literal["compliant", "rigid", "euler"]
BatchSolver = Literal["compliant", "rigid"]
Hypothesis = Literal["energetic", "poisson", "newton"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with arguments, those of the command line by default, and return its exit status.

    See :func:`sledenv.command.running.run`.
    """
    return run(command, arguments)


def _named(folder: Literal["scenarios", "studies", "suites"]) -> Parameter:
    """Return what completes the names of shipped files and the paths of others."""

    def offered(context: CompletionContext) -> list[str]:
        from sledenv.scenarios.configuration import shipped

        return [*shipped(folder), *glob(f"{context.incomplete}*.yaml")]

    return Parameter(completer=offered)


def _folder(_: Any, tokens: Sequence[Token]) -> Path:
    from sledenv.machine.files import check_folder

    folder = Path(tokens[0].value)
    try:
        check_folder(folder)
    except OSError as error:
        raise ValueError(str(error)) from error
    return folder


def _fixed(_: Any, tokens: Sequence[Token]) -> list[tuple[str, float]]:
    pairs = []
    for token in tokens:
        name, _, value = token.value.partition("=")
        try:
            pairs.append((name, float(value)))
        except ValueError:
            raise CoercionError(msg=f"must be NAME=VALUE: {token.value!r}", token=token) from None
    return pairs


Scenario = Annotated[
    str, Parameter(help="Name (sledenv scenarios lists them), or a file that ends in .yaml"), _named("scenarios")
]
Surfaces = Parameter(help="Contact model; rigid ignores the stiffness")
Json = Annotated[bool, Parameter(help="Print the result as one JSON document")]
Folder = Annotated[Path, Parameter(metavar="FOLDER", converter=_folder)]
File = Annotated[Path, Parameter(metavar="FILE")]
Fixed = Annotated[tuple[tuple[str, float], ...], Parameter(metavar="NAME=VALUE", converter=_fixed, n_tokens=1)]
Workers = Annotated[Count, Parameter(help="Processes (default: one a core)")]
Ray = Annotated[
    str, Parameter(metavar="ADDRESS", help='Use the Ray cluster at this address instead, or start one here: "local"')
]


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
    orientation_deg: Annotated[float | None, Parameter(metavar="DEG"), within(360.0, "deg")] = None
    spin: Annotated[float | None, Parameter(metavar="RAD_S"), within(1e6, "rad/s")] = None
    speed: Annotated[float | None, Parameter(metavar="M_S"), within(1e6, "m/s")] = None


_DRAWN = Launch()


@command.command
def simulate(
    scenario: Scenario,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[Solver, Surfaces] = "compliant",
    out: Folder | None = None,
    csv: File | None = None,
    json: Json = False,
) -> None:
    """Simulate one descent of a scenario.

    Prints what was simulated, the rebounds, how it ended, jam metrics and energy ledger. Positions and velocities are
    those of the mass centre, in the frame of the slope: x downhill, y along the outward normal, angles
    counter-clockwise.

    A rebound is a contact, short or long: t and x are those of its end, velocities those before and after. grip is the
    impulse of friction over the most that it could be, loss the share of u that is gone, 0 where u has grown. A last
    contact in which the descent ends is there as well.

    Parameters
    ----------
    out
        Write strobe.png and series.png into this folder.
    csv
        Write the trajectory as this table, units in the header.
    """
    from sledenv.machine.files import publish, replacing, write_csv
    from sledenv.pages.as_json import plain_descent
    from sledenv.pages.words import TRAJECTORY_COLUMNS, story, trajectory_rows

    if out is not None and csv is not None and csv.parent.resolve() == out.resolve():
        raise ValueError(f"--csv = {csv}: must lie outside {out}, which --out replaces as a whole")
    with ExitStack() as places:  # taken before anything is simulated
        table = csv and _place(places, "--csv", replacing(csv, ".csv"))
        folder = out and _place(places, "--out", publish(out, PICTURES))
        asked = _asked(scenario, launch, solver)
        descent = _descend(asked, "trajectory" if table or folder else "rebounds")
        if table:
            write_csv(table, list(TRAJECTORY_COLUMNS.values()), trajectory_rows(descent))
        if folder:
            _draw(descent, folder)
    lines = [asked.title, story(descent)]
    if table:
        columns = ", ".join(TRAJECTORY_COLUMNS.values())
        lines.append(f"simulate: wrote {len(descent.trajectory)} rows into {csv}\n  columns {columns}")
    if folder:
        lines.append(f"simulate: wrote {' and '.join(PICTURES)} into {out}")
    written = [file for file in (csv, *(out / name for name in PICTURES if out)) if file]
    tell("\n".join(lines), asked.named | plain_descent(descent) | {"written": written}, json)


@command.command
def sensitivity(
    scenario: Scenario,
    /,
    *,
    launch: Launch = _DRAWN,
    solver: Annotated[BatchSolver, Surfaces] = "compliant",
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
    from sledenv.pages.words import sensitivity_table, setting
    from sledenv.simulation.sensitivity import sensitivity as differentiate

    with ExitStack() as places:
        picture = out and _place(places, "--out", replacing(out, ".png"))
        asked = _asked(scenario, launch, solver)
        with working("sensitivity"):
            found = differentiate(*asked.given, asked.settings, rebounds=rebounds)
        if picture:
            from sledenv.plot import plot_growth

            plot_growth(found).savefig(picture, dpi=_DPI, format="png")
    lines = [asked.title, setting(*asked.given), "", sensitivity_table(found)]
    lines += [f"sensitivity: wrote {out}"] if out else []
    data = asked.named | plain_setting(*asked.given) | plain_sensitivity(found)
    tell("\n".join(lines), data | {"written": [out] if out else []}, json)


@command.command
def scenarios(*, json: Json = False) -> None:
    """List the shipped scenarios: name, what an agent chooses, solver, and what is asked."""
    from rich.table import Table

    from sledenv.scenarios.scenario import load_scenario, scenario_names
    from sledenv.scenarios.sections import control_words

    shipped = [load_scenario(name) for name in scenario_names()]
    rows = [
        (one.id, control_words(one.control_bounds)[one.control.chosen], "compliant", one.question) for one in shipped
    ]
    table = Table("name", "agent chooses", "solver", "what is asked", box=None, pad_edge=False)
    for name, chosen, solver, question in rows:
        table.add_row(name, ", ".join(chosen), solver, question)
    tell(table, [dict(zip(("name", "agent_chooses", "solver", "question"), row, strict=True)) for row in rows], json)


@command.command
def replay(
    scenario: Scenario,
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
        page = _place(places, "--out", replacing(out, ".html", ".htm"))
        asked = _asked(scenario, launch, solver)
        page.write_text(replay_page(_descend(asked, "trajectory"), asked.title), encoding="utf-8")
    tell(f"replay: wrote {out}", asked.named | {"written": [out]}, json)


@command.command(name="reproduce")
def reproduce_paper(*, out: Folder = Path("reproduction"), json: Json = False) -> None:
    """Compute every number and figure of the paper.

    Everything quantitative in it: figures, maps, and a table of its numbers and ours.

    Parameters
    ----------
    out
        Folder of the results.
    """
    from sledenv.reproduce import reproduce

    folder = reproduce(out, progress=progress("reproduce"))
    with (folder / "table.csv").open(encoding="utf-8", newline="") as lines:
        from csv import DictReader

        rows = list(DictReader(lines))
    tell(f"reproduce: wrote {folder / 'index.md'}", {"numbers": rows, "written": [folder / "index.md"]}, json)


@command.command
def benchmark(
    *,
    suite: Annotated[str, _named("suites")] = "smoke",
    out: Folder | None = None,
    workers: Workers | None = None,
    ray: Ray | None = None,
    json: Json = False,
) -> None:
    """Train and judge the agents of a suite, and write the report.

    Trains and judges every agent of a suite on every scenario, gathers the numbers as Parquet files and writes the
    report. What has been done already is kept, so that a run which was stopped goes on.

    Parameters
    ----------
    suite
        smoke, minutes, full, trims, or a file that ends in .yaml.
    out
        Default: runs/benchmark/SUITE.
    """
    from sledenv.benchmark.report import write_report
    from sledenv.benchmark.runner import run_suite
    from sledenv.benchmark.scores import read_results, scores
    from sledenv.benchmark.suite import Suite
    from sledenv.benchmark.tables import shown

    one = Suite.load(suite)
    folder = run_suite(one, out or Path("runs/benchmark") / one.id, workers=workers, ray=ray)
    results = read_results(folder)
    page, found = write_report(results, folder / "report"), scores(results)
    if not json:
        tell(shown(found), None, json)
    tell(f"benchmark: wrote {page}", {"suite": one.id, "scores": found, "written": [page]}, json)


@command.command
def study(
    study: Annotated[str, _named("studies")],
    /,
    *,
    out: Folder | None = None,
    launches: Count | None = None,
    workers: Workers | None = None,
    ray: Ray | None = None,
    json: Json = False,
) -> None:
    """Tell what uncertain launches, laws, slopes and bodies mean for the descent.

    Draws what a study calls uncertain, simulates a descent for each draw, and tells how they end, with quantiles,
    envelopes along the slope and Sobol indices. A study that was stopped goes on where it was, and so does one with
    more launches.

    Parameters
    ----------
    study
        brake_stop, push_off, or a file that ends in .yaml.
    out
        Default: runs/study/STUDY.
    launches
        At least so many (default: what the study says).
    """
    import sledenv

    given = sledenv.load_study(study)
    folder = out or Path("runs/study") / given.id
    found = sledenv.study(given, folder, launches=launches, workers=workers, ray=ray)
    title = f"{given.id}, {found.launches} launches, solver {given.solver}: {given.question or given.title}"
    tables = {name: getattr(found, name) for name in ("shares", "quantiles", "envelopes", "sobol")}
    named = {"study": given.id, "launches": found.launches, "solver": given.solver}
    tell(f"{title}\n{found.words}\nstudy: wrote {folder}", named | tables | {"written": [folder]}, json)


@command.command(name="map")
def draw_map(
    scenario: Scenario,
    /,
    *,
    seed: Seed = 0,
    runs: Annotated[tuple[Path, ...] | None, Parameter(name="--run", metavar="RUN")] = None,
    out: File | None = None,
    html: File | None = None,
    seeds: Seeds | None = None,
    json: Json = False,
) -> None:
    """Draw the jam map of a context, the reward of every launch, or make it a page to play them.

    Draws the reward of all launches of one context, with the best one and what trained agents choose; or writes a page
    for any browser, offline, that plays the descent of each of them.

    Parameters
    ----------
    seed
        Which context of the scenario is drawn.
    runs
        Folder of a trained agent, or the name of one that ships; may be repeated (default of a page: the shipped one).
    out
        Picture (default: map.png, unless --html is given).
    html
        Write this page.
    seeds
        Contexts to page through in it (default: that of --seed).
    """
    from sledenv.benchmark.landscape import landscape
    from sledenv.benchmark.map_page import map_page
    from sledenv.machine.files import replacing

    if seeds and html is None:
        raise ValueError(f"--seeds = {list(seeds)}: only a page has several contexts, see --html")
    picture = out or (None if html else Path("map.png"))
    with ExitStack() as places:
        page = html and _place(places, "--html", replacing(html, ".html", ".htm"))
        drawing = picture and _place(places, "--out", replacing(picture, ".png"))
        if drawing:
            with working("map"):
                drawn = landscape(scenario, seed, runs or ())
                drawn.figure.savefig(drawing, dpi=_DPI, format="png")
            words, contexts = drawn.words, [drawn.marks]
        if page:
            made = map_page(scenario, seeds or (seed,), runs)
            page.write_text(made.html, encoding="utf-8")
            words, contexts = made.words, made.marks
    written = [file for file in (picture, html) if file]
    data = {"scenario": scenario, "contexts": contexts, "written": written}
    tell("\n".join([words, *(f"map: wrote {file}" for file in written)]), data, json)


@Parameter(name="*")
@dataclass(frozen=True)
class Shape:
    """What a body is like.

    Parameters
    ----------
    gyration_radius
        Root of inertia over mass [m].
    radius
        Of the arc [m], for a table with phi_rad.
    eccentricity
        Of the mass centre in the arc [m].
    half_angle_deg
        Of the arc; 180 has no corners.
    """

    gyration_radius: Annotated[float, Parameter(metavar="M"), positive("m")]
    radius: Annotated[float | None, Parameter(metavar="M"), positive("m")] = None
    eccentricity: Annotated[float, Parameter(metavar="M")] = 0.0
    half_angle_deg: Annotated[float, Parameter(metavar="DEG")] = 180.0

    def body(self, mass: float) -> Body:
        """Return the body of this mass."""
        from sledenv.simulation.bodies import Body

        if self.radius is None:
            raise ValueError("--radius: poses over time need it")
        inertia = mass * self.gyration_radius**2
        return Body(mass, self.radius, self.eccentricity, inertia, math.radians(self.half_angle_deg))


@Parameter(name="*", group=Group("For rebounds", sort_key=1))
@dataclass(frozen=True)
class Rebounds:
    """What only a table of rebounds needs.

    Parameters
    ----------
    hypothesis
        Of restitution.
    softening
        Let the restitution depend on the approach speed.
    compare
        Cross-validate other laws too.
    folds
        Parts for that.
    starts
        Of the fit.
    """

    hypothesis: Hypothesis = "energetic"
    softening: bool = False
    compare: bool = False
    folds: Count = 10
    starts: Count = 16


@Parameter(name="*", group=Group("For poses over time", help="These need --radius and --slope-deg.", sort_key=2))
@dataclass(frozen=True)
class Tracks:
    """What only poses over time need.

    Parameters
    ----------
    slope_deg
        Inclination; x runs downhill.
    mass
        Stiffness is in proportion.
    surfaces
        Compliant fits a stiffness too.
    position_noise
        Standard deviation; default: estimated.
    angle_noise_deg
        The same of the orientation.
    """

    slope_deg: Annotated[float | None, Parameter(metavar="DEG"), within(89.0, "deg")] = None
    gravity: Annotated[float, Parameter(metavar="M_S2"), positive("m/s^2")] = 9.81
    mass: Annotated[float, Parameter(metavar="KG"), positive("kg")] = 1.0
    surfaces: BatchSolver = "rigid"
    position_noise: Annotated[float | None, Parameter(metavar="M"), positive("m")] = None
    angle_noise_deg: Annotated[float | None, Parameter(metavar="DEG"), positive("deg")] = None

    def slope(self) -> Slope:
        """Return the slope."""
        from sledenv.simulation.scene import Slope

        if self.slope_deg is None:
            raise ValueError("--slope-deg: poses over time need it")
        return Slope(math.radians(self.slope_deg), gravity=self.gravity)

    def noise(self) -> tuple[float, float] | None:
        """Return the noise of positions [m] and angles [rad], None if it is to be estimated."""
        match self.position_noise, self.angle_noise_deg:
            case None, None:
                return None
            case float(position), float(angle):
                return position, math.radians(angle)
        raise ValueError("--position-noise, --angle-noise-deg: both must be given, or none")


_USUAL, _NO_TRACKS = Rebounds(), Tracks()


@command.command
def identify(
    file: File,
    /,
    *,
    shape: Shape,
    rebounds: Rebounds = _USUAL,
    tracks: Tracks = _NO_TRACKS,
    fix: Fixed = (),
    seed: Seed = 0,
    out: Folder | None = None,
    json: Json = False,
) -> None:
    """Fit a contact law to measured rebounds, or to poses over time.

    Fits restitution, friction and rolling arms to what was measured of one body, and prints them with their intervals.
    Columns of a table of rebounds, with their units: u_before_m_s, v_before_m_s, omega_before_rad_s, the same with
    after, and phi_rad or the arms a_m and b_m of the contact. Of poses over time: t_s, x_m, y_m and phi_rad, in the
    frame of the slope. recording, which tells recordings apart, is optional.

    Parameters
    ----------
    file
        That ends in .csv or .parquet.
    fix
        Do not fit this parameter: restitution, friction, rolling_arm, corner_rolling_arm; may be repeated.
    seed
        Of starts and folds.
    out
        Write tables and figures into this folder.
    """
    from sledenv.identification.choice import holds_tracks
    from sledenv.identification.recorded_tables import read_table
    from sledenv.machine.files import publish

    table = read_table(file)
    if holds_tracks(table):
        files, fit = _of_tracks(table, shape, tracks, fixed=dict(fix), seed=seed)
    else:
        files, fit = _of_rebounds(table, shape, rebounds, fixed=dict(fix), seed=seed)
    with ExitStack() as places:
        folder = out and _place(places, "--out", publish(out, files))
        with working("identify"):
            text, data, write = fit()
        if folder:
            write(folder)
    tell(text + (f"\nidentify: wrote {out}" if out else ""), data | {"written": [out] if out else []}, json)


# What is written, and the fit: its words, its data, and what writes it into a folder.
_Fit = tuple[Collection[str], Callable[[], tuple[str, dict[str, Any], Callable[[Path], None]]]]


def _of_rebounds(table: pd.DataFrame, shape: Shape, how: Rebounds, fixed: dict[str, float], seed: int) -> _Fit:
    from sledenv.identification.comparison import compare
    from sledenv.identification.rebound_fit import identify
    from sledenv.identification.report import COMPARED, FILES, write_identification

    body = None if shape.radius is None else shape.body(1.0)

    def fit() -> tuple[str, dict[str, Any], Callable[[Path], None]]:
        found = identify(
            table,
            body,
            gyration_radius=None if body else shape.gyration_radius,
            hypothesis=how.hypothesis,
            fixed=fixed,
            speed_dependent=how.softening,
            starts=how.starts,
            seed=seed,
        )
        text, data = str(found), {"parameters": found.table, "warnings": found.warnings}
        compared = compare(found.rebounds, folds=how.folds, seed=seed) if how.compare else None
        if compared is not None:
            data |= {"models": compared.table, "differences": compared.differences()}
            text += f"\n\nerrors on rebounds held out\n{data['models'].round(4).to_string()}"
            text += f"\n\nand how much larger than the best\n{data['differences'].round(4).to_string()}"
        return text, data, lambda folder: write_identification(found, folder, compared)

    return (*FILES, *COMPARED), fit


def _of_tracks(table: pd.DataFrame, shape: Shape, how: Tracks, fixed: dict[str, float], seed: int) -> _Fit:
    from sledenv.identification.report import track_files, write_tracks
    from sledenv.identification.tracks import identify_tracks

    body, slope, noise = shape.body(how.mass), how.slope(), how.noise()

    def fit() -> tuple[str, dict[str, Any], Callable[[Path], None]]:
        found = identify_tracks(table, body, slope, solver=how.surfaces, fixed=fixed, noise=noise, seed=seed)
        launches = {name: launch._asdict() for name, launch in found.launches.items()}
        tables = {"recordings": found.used, "parameters": found.table}
        data = tables | {"launches": launches, "warnings": found.warnings}
        return str(found), data, lambda folder: write_tracks(found, folder)

    return track_files(table["recording"].nunique() if "recording" in table else 1), fit


@command.command
def doctor(*, json: Json = False) -> int:
    """Compile all kernels beforehand and check the installation.

    Compiles all kernels into the cache, so that nothing is compiled on first use; reports versions, processor, threads
    and cache; checks results that are known. Ends with status 1 if something is wrong.
    """
    from sledenv.command.doctor import examine

    report: dict[str, list[str]] = {}

    def note(line: str) -> None:
        name, _, words = line.partition(" ")
        report.setdefault(name, []).append(words.strip())
        print(line, file=sys.stderr if json else sys.stdout, flush=True)

    problems = examine(note)
    for problem in problems:
        print(f"sledenv doctor: {problem}", file=sys.stderr)
    tell("something is wrong" if problems else "all is well", {"problems": problems, "report": report}, json)
    return FAILED if problems else 0


class _Asked(NamedTuple):
    """Which descent the arguments mean."""

    named: dict[str, Any]
    given: tuple[Body, ContactLaw, Slope, State]
    settings: Settings

    @property
    def title(self) -> str:
        """Its name."""
        return "{scenario}, seed {seed}, solver {solver}".format(**self.named)


def _asked(name: str, chosen: Launch, solver: Solver) -> _Asked:
    import numpy as np

    from sledenv.scenarios.scenario import load_scenario

    scenario = load_scenario(name)
    context = scenario.sample(np.random.default_rng(chosen.seed))
    if solver == "euler" and scenario.ends.on_chord:
        raise ValueError(
            f"--solver: {scenario.id} ends where the body lies on its chord (ends.on_chord), which 'euler' cannot tell"
        )
    orientation = None if chosen.orientation_deg is None else math.radians(chosen.orientation_deg)
    launch = scenario.launch(context, orientation, chosen.spin, chosen.speed)
    return _Asked(
        {"scenario": scenario.id, "seed": chosen.seed, "solver": solver},
        (scenario.body(), scenario.law(context), scenario.slope(context), launch),
        scenario.settings(solver),
    )


def _descend(asked: _Asked, record: Record) -> Descent:
    from sledenv.simulation.simulate import simulate

    with working("descent"):
        return simulate(*asked.given, asked.settings, record=record)


def _draw(descent: Descent, folder: Path) -> None:
    from sledenv.plot import plot_descent, plot_strobe

    plot_strobe(descent).savefig(folder / PICTURES[0], dpi=_DPI)
    plot_descent(descent).savefig(folder / PICTURES[1], dpi=_DPI)


def _place(places: ExitStack, option: str, place: AbstractContextManager[Path]) -> Path:
    """Take a place to write to; what is wrong with it is said of the option."""
    try:
        return places.enter_context(place)
    except OSError as error:
        raise OSError(f"{option}: {error}") from error


if __name__ == "__main__":
    sys.exit(main())
