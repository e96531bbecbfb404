"""How a descent is simulated: one object that travels from the user, a scenario or an environment to the kernel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, get_args

from sledenv.kernel.params import Limits
from sledenv.simulation.rules import NOT_NEGATIVE, POSITIVE, Rule, checked, checked_choice, checked_count, checked_flag

Solver = Literal["compliant", "rigid", "euler"]
BatchSolver = Literal["compliant", "rigid"]
FrictionSign = Literal["dissipative", "printed"]

# Of one call of the kernel, a fraction of a second: an interrupt takes effect between two of them.
WORK = 1e5  # steps in contact, and hops
EULER_WORK = 2e6

_SOLVERS, _BATCH_SOLVERS, _SIGNS = get_args(Solver), get_args(BatchSolver), get_args(FrictionSign)
_MOST_STEPS = 1e6  # in contact; Euler's method, whose steps are those of a descent, has no such limit
_RULES: Final[dict[str, Rule]] = {
    "max_time": POSITIVE,
    "tolerance": (lambda v: (v >= 1e-18) & (v <= 1e-3), "in [1e-18, 1e-3]"),
    "sample_interval": (lambda v: (v >= 1e-12) & (v < math.inf), "in [1e-12, inf) s"),
    "step": POSITIVE,
    "run_out": (NOT_NEGATIVE[0], "in [0, inf) m"),
    "settle_speed": (NOT_NEGATIVE[0], "in [0, inf) m/s"),
}


@dataclass(frozen=True)
class Settings:
    """How descents are simulated; immutable, hashable, checked once, when it is made.

    ``dataclasses.replace(settings, solver="rigid")`` is another one with other fields.

    Parameters
    ----------
    solver : {"compliant", "rigid", "euler"}
        The two-stiffness contact, event-driven (docs/physics.md, section 5); its stiff limit, with impacts in normal
        impulse and sustained contact (sections 4 and 6), which takes the restitution of the law and ignores its
        stiffness; or the paper's explicit Euler method, which only :func:`sledenv.simulate` follows.
    max_time : float
        Longest simulated time [s], > 0.
    max_rebounds : int
        Number of rebounds after which a descent ends with status "log_full".
    end_on_chord : bool
        End a descent with status "tumbled" where the body first lies on its chord, both ends settled, and slides on.
        It goes on otherwise. Needs another solver than "euler", in which nothing settles.
    end_touching : str, optional
        End a descent with status "tumbled" where a part of this name touches the slope, or a straight side of this name
        lies on it: one of ``Body.parts``.
    run_out : float
        How far behind the end of the slope the descent goes on [m], >= 0. It is judged where it passes the line there,
        but one that crashes in the run-out keeps nothing. The slope, and its last zone if that is endless, goes on too.
    settle_speed : float, optional
        Approach speed [m/s] below which an impact is plastic ("rigid"), so that ever smaller bounces come to an end;
        1e-5 sqrt(gravity times the size of the body) by default. 0 follows the bounces until the log is full.
    tolerance : float
        Last terms of the series of a contact step, relative to the speed scale of the contact ("compliant").
    sample_interval : float
        Longest time [s] between two rows of a trajectory; contacts are sampled more densely.
    step : float
        Time step [s] ("euler").
    friction_sign : {"dissipative", "printed"}
        "printed" gives the moment of friction the sign printed in the paper's (10), which creates energy; it exists to
        reproduce the paper and needs ``solver="euler"``.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    solver: Solver = "compliant"
    max_time: float = 60.0
    max_rebounds: int = 1000
    end_on_chord: bool = False
    end_touching: str | None = None
    run_out: float = 0.0
    settle_speed: float | None = None
    tolerance: float = 1e-14
    sample_interval: float = 0.01
    step: float = 2.5e-7
    friction_sign: FrictionSign = "dissipative"

    def __post_init__(self) -> None:
        checked_choice("Settings.solver", self.solver, _SOLVERS)
        checked_choice("Settings.friction_sign", self.friction_sign, _SIGNS)
        plain: dict[str, Any] = {
            "max_rebounds": checked_count("Settings.max_rebounds", self.max_rebounds),
            "end_on_chord": checked_flag("Settings.end_on_chord", self.end_on_chord),
        }
        for name, rule in _RULES.items():
            value = getattr(self, name)
            if value is not None or name != "settle_speed":
                plain[name] = checked("Settings", name, value, rule)
        for name, value in plain.items():
            if getattr(self, name) is not value:  # a number of another kind was given
                object.__setattr__(self, name, value)
        if self.solver != "euler" and self.friction_sign == "printed":
            raise ValueError(
                "Settings.friction_sign = 'printed': only solver = 'euler' reproduces the paper's printed sign"
            )
        if self.end_touching is not None and not isinstance(self.end_touching, str):
            raise TypeError(f"Settings.end_touching = {self.end_touching!r}: must be the name of a part of the body")
        if self.solver == "euler" and self.end_touching is not None:
            raise ValueError(f"Settings.end_touching = {self.end_touching!r}: solver = 'euler' does not heed it")
        if self.solver == "euler" and self.end_on_chord:
            raise ValueError(
                "Settings.end_on_chord = True: solver = 'euler' cannot tell when a body has settled on its chord"
            )

    @property
    def limits(self) -> Limits:
        """What the kernel takes of them: numbers alone, and so without the part of ``end_touching``."""
        euler = self.solver == "euler"
        return Limits(
            max_time=self.max_time,
            max_steps=1e18 if euler else _MOST_STEPS,
            tolerance=self.tolerance,
            sample_interval=self.sample_interval,
            step=self.step,
            printed_sign=1.0 if self.friction_sign == "printed" else 0.0,
            max_rebounds=float(self.max_rebounds),
            end_on_chord=1.0 if self.end_on_chord else 0.0,
            end_part=0.0,
            run_out=self.run_out,
            most_work=EULER_WORK if euler else WORK,
        )


DEFAULT: Final = Settings()


def changed(settings: Settings | None, fields: dict[str, Any]) -> Settings:
    """Return settings, the default ones for None, with some fields in place of theirs; raises as :class:`Settings`."""
    if settings is not None and not isinstance(settings, Settings):
        raise _no_settings(settings)
    if not fields:
        return settings or DEFAULT
    return Settings(**fields) if settings is None else replace(settings, **fields)


def checked_settings(settings: Settings | None) -> Settings:
    """Return settings that exact events can be found with, the default ones for None, or raise an error.

    Raises
    ------
    TypeError, ValueError
        If they are of another kind, or ask for Euler's method.
    """
    if settings is None:
        return DEFAULT
    if not isinstance(settings, Settings):
        raise _no_settings(settings)
    checked_choice("Settings.solver", settings.solver, _BATCH_SOLVERS)
    return settings


def _no_settings(given: object) -> TypeError:
    return TypeError(f"settings = {given!r}: must be Settings, such as Settings(solver='rigid')")
