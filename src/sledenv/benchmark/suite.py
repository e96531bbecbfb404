"""Suites: which agents are judged on which scenarios, read from YAML."""

from __future__ import annotations

import os
from collections.abc import Mapping
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, get_args

from pydantic import Field, field_validator, model_validator

from sledenv.benchmark.problem import Environment, Problem
from sledenv.benchmark.runs import SETTINGS, agent_class, agent_name, budgeted, problem_of, read_settings
from sledenv.scenarios.configuration import Document, Section, Whole
from sledenv.scenarios.scenario import Context, ScenarioError, load_scenario


class SuiteError(ScenarioError):
    """A suite that cannot be run; the message names the file, the key, its value and what is allowed."""


class Job(NamedTuple):
    """One agent on one scenario with one seed."""

    module: str
    environment: Environment
    scenario: str
    seed: int
    settings: dict[str, Any]
    given: Mapping[str, Any] = {}  # what the suite says of its problems
    variant: str = ""

    @property
    def agent(self) -> str:
        """Short name of the agent, with that of its variant."""
        return "-".join(filter(None, (agent_name(self.module), self.variant)))

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{self.environment}-{Path(self.scenario).stem}-{self.agent}-s{self.seed}"

    def problem(self) -> Problem:
        """Return what the agent is given."""
        return problem_of(self.scenario, self.environment, self.settings, **self.given)


class Entry(Section):
    """How often an agent of a suite is trained, and with which settings of its own."""

    seeds: Annotated[int, Whole("[1, 1000]")]
    # name -> settings in place of those of the file; default: one variant without a name and without changes
    variants: Annotated[dict[str, dict[str, Any]], Field(default_factory=dict)]

    @field_validator("variants")
    @classmethod
    def _nameable(cls, variants: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        wrong = [name for name in variants if not name.isidentifier()]  # it is a part of the names of files
        if wrong:
            raise ValueError(f"must have names of letters, digits and _, not {wrong[0]!r}")
        return variants

    @model_validator(mode="before")
    @classmethod
    def _alone(cls, given: Any) -> Any:
        return given if isinstance(given, Mapping) else {"seeds": given}


class Suite(Document):
    """A benchmark: every agent of an environment on every scenario of it, on the same held-out contexts.

    The keys are those of the YAML file, where a list of ``scenarios`` is for all environments. Instances are
    immutable.
    """

    called: ClassVar[str] = "suite"
    folder: ClassVar[str] = "suites"
    error: ClassVar[type[ValueError]] = SuiteError

    contexts: Annotated[int, Whole("[2, 100000]")]  # held-out contexts of each scenario
    scenarios: dict[Environment, Annotated[tuple[str, ...], Field(min_length=1)]]  # as for load_scenario
    # module of the agent -> number of seeds, or an Entry
    agents: Annotated[dict[Environment, Annotated[dict[str, Entry], Field(min_length=1)]], Field(min_length=1)]
    settings: str = str(SETTINGS)  # folder of the hyperparameters, as seen from the file
    steps: Annotated[int | None, Whole("[1, 1000000000]")] = None  # budget in place of the configured one
    observe: Literal["all"] | tuple[str, ...] = "all"  # fields of the context that agents see
    exact: bool = False  # whether launches are hit exactly, which is a track of its own

    @model_validator(mode="before")
    @classmethod
    def _in_all(cls, given: Any) -> Any:
        if isinstance(given, Mapping) and isinstance(given.get("scenarios"), (list, tuple)):
            of = given["agents"] if isinstance(given.get("agents"), Mapping) else get_args(Environment)
            return {**given, "scenarios": dict.fromkeys(of, given["scenarios"])}
        return given

    @field_validator("scenarios")
    @classmethod
    def _known(cls, scenarios: dict[Environment, tuple[str, ...]]) -> dict[Environment, tuple[str, ...]]:
        for names in scenarios.values():
            ids = {load_scenario(name).id for name in names}
            if len(ids) < len(names) or len({Path(name).stem for name in names}) < len(names):
                raise ValueError("must not repeat a scenario, its id or the name of its file")
        # A worker may have another working folder.
        return {
            kind: tuple(os.path.abspath(name) if name.endswith(".yaml") else name for name in names)
            for kind, names in scenarios.items()
        }

    @field_validator("agents")
    @classmethod
    def _told_apart(cls, agents: dict[Environment, dict[str, Entry]]) -> dict[Environment, dict[str, Entry]]:
        for modules in agents.values():
            names = [agent_name(module) for module in modules]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"must not have two agents called {name!r}")
        return agents

    @field_validator("observe")
    @classmethod
    def _seen(cls, observe: Literal["all"] | tuple[str, ...]) -> Literal["all"] | tuple[str, ...]:
        unknown = [] if observe == "all" else [name for name in observe if name not in Context.seen]
        if unknown:
            raise ValueError(f"must be 'all' or list fields of the context, {', '.join(Context.seen)}")
        return observe

    @model_validator(mode="after")
    def _asked_of_someone(self) -> Self:
        if self.scenarios.keys() != self.agents.keys():
            raise ValueError(f"scenarios: must be a list, or have the keys of agents: {', '.join(self.agents)}")
        return self

    @property
    def words(self) -> str:
        """Words for what is to be done."""
        jobs = self.jobs()
        agents, scenarios = len({job.module for job in jobs}), len({job.scenario for job in jobs})
        asked = f"{len(jobs)} jobs ({agents} agents with their seeds, scenarios: {scenarios})"
        return f"suite {self.id}, {self.title}: {asked}, each judged in {self.contexts} contexts"

    def questions(self) -> list[tuple[str, Environment]]:
        """Return each scenario with each environment in which it is asked."""
        return [(scenario, kind) for kind, names in self.scenarios.items() for scenario in names]

    def problem(self, scenario: str, environment: Environment = "launch") -> Problem:
        """Return what the agents of the suite are given in a scenario."""
        return Problem(scenario, environment, **self._given())

    def _given(self) -> dict[str, Any]:
        return {"observe": self.observe} | ({"launch_noise": (0.0, 0.0)} if self.exact else {})

    @classmethod
    def seen_from(cls, folder: Path, content: Any) -> Any:
        """Return what a file in a folder holds, with the folder of its settings as it is seen from here."""
        if isinstance(content, dict) and isinstance(content.get("settings"), str):
            content |= {"settings": os.path.abspath(folder / content["settings"])}
        return content

    def jobs(self) -> list[Job]:
        """Return everything to train and to judge.

        Jobs of one seed of all agents and scenarios come before those of the next, so that a suite that is stopped
        early has seen everything.

        Raises
        ------
        SuiteError
            If there is no folder of settings, an agent cannot be imported or has none for its environment.
        """
        if not Path(self.settings).is_dir():
            raise SuiteError(f"suite {self.id}: settings = {self.settings!r}: there is no such folder")
        jobs = [
            Job(module, kind, scenario, seed, settings, self._given(), variant)
            for scenario, kind in self.questions()
            for module, entry in self.agents[kind].items()
            for variant, changes in (entry.variants or {"": {}}).items()
            for settings in [self._settings(module, scenario, kind, changes)]
            for seed in range(entry.seeds)
        ]
        return sorted(jobs, key=attrgetter("seed"))

    def _settings(self, module: str, scenario: str, kind: Environment, changes: dict[str, Any]) -> dict[str, Any]:
        """Return the settings of an agent, those of its file with what a variant changes."""
        try:
            agent_class(module)
            settings = read_settings(Path(self.settings), module, kind)
            problem_of(scenario, kind, settings, **self._given())
            if unknown := sorted(changes.keys() - settings.keys()):
                known = ", ".join(settings) or "none"
                raise ValueError(f"agent {module}, variants: {unknown[0]!r} is no setting; there are {known}")
        except ValueError as error:
            raise SuiteError(f"suite {self.id}: {error}") from error
        return budgeted(settings | changes, self.steps)
