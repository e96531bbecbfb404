"""How a descent is simulated: one object that travels from the user, a scenario or an environment to the kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypedDict, Unpack, get_args

from sledenv.kernel.params import Limits
from sledenv.simulation.rules import NOT_NEGATIVE, POSITIVE, Rule, checked, checked_choice, checked_count, checked_flag

Solver = Literal["compliant", "rigid"]

# Of one call of the kernel, a fraction of a second: an interrupt takes effect between two of them.
WORK = 1e5  # steps in contact, and hops

_SOLVERS = get_args(Solver)
_MOST_STEPS = 1e6  # in contact
_NOT_HERE = (
    f"Settings.solver = 'euler': must be one of {', '.join(map(repr, _SOLVERS))}; the paper's own method is "
    "sledenv.reproduce.euler_descent"
)
_RULES: Final[dict[str, Rule]] = {
    "max_time": POSITIVE,
    "tolerance": (lambda v: (v >= 1e-18) & (v <= 1e-3), "in [1e-18, 1e-3]"),
    "sample_interval": (lambda v: (v >= 1e-12) & (v < math.inf), "in [1e-12, inf) s"),
    "run_out": (NOT_NEGATIVE[0], "in [0, inf) m"),
    "settle_speed": (NOT_NEGATIVE[0], "in [0, inf) m/s"),
}


@dataclass(frozen=True)
class Settings:
    """How descents are simulated; immutable, hashable, checked once, when it is made.

    ``dataclasses.replace(settings, solver="rigid")`` is another one with other fields.

    Parameters
    ----------
    solver : {"compliant", "rigid"}
        The two-stiffness contact, event-driven (docs/physics.md, section 5); or its stiff limit, with impacts in normal
        impulse and sustained contact (sections 4 and 6), which takes the restitution of the law and ignores its
        stiffness. The paper's own method is :func:`sledenv.reproduce.euler_descent`.
    max_time : float
        Longest simulated time [s], > 0.
    max_rebounds : int
        Number of rebounds after which a descent ends with status "log_full".
    end_on_chord : bool
        End a descent with status "tumbled" where the body first lies on its chord, both ends settled, and slides on.
        It goes on otherwise.
    end_touching : str or sequence of str, optional
        End a descent with status "tumbled" where a part of such a name touches the slope, or a straight side of such a
        name lies on it: of ``Body.parts``.
    run_out : float
        How far behind the end of the slope the descent goes on [m], >= 0. It is judged where it passes the finish,
        but one that falls in the run-out keeps nothing. The slope, and its last zone if that is endless, goes on too.
    settle_speed : float, optional
        Approach speed [m/s] below which an impact is plastic ("rigid"), so that ever smaller bounces come to an end;
        1e-5 sqrt(gravity times the size of the body) by default. 0 follows the bounces until the log is full.
    tolerance : float
        Ten times the first terms that the series of a contact step leave out, relative to the speed of the body
        ("compliant").
    sample_interval : float
        Longest time [s] between two rows of a trajectory; contacts are sampled more densely.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    solver: Solver = "compliant"
    max_time: float = 60.0
    max_rebounds: int = 1000
    end_on_chord: bool = False
    end_touching: str | Sequence[str] | None = None
    run_out: float = 0.0
    settle_speed: float | None = None
    tolerance: float = 1e-14
    sample_interval: float = 0.01

    def __post_init__(self) -> None:
        if str(self.solver) == "euler":
            raise ValueError(_NOT_HERE)
        checked_choice("Settings.solver", self.solver, _SOLVERS)
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
        given = self.end_touching
        if given is not None and not isinstance(given, str):
            if not isinstance(given, Sequence) or not given or not all(isinstance(name, str) for name in given):
                raise TypeError(
                    f"Settings.end_touching = {given!r}: must be the name of a part of the body, or several"
                )
            object.__setattr__(self, "end_touching", tuple(given))

    @property
    def end_parts(self) -> tuple[str, ...]:
        """Names of the parts of ``end_touching``."""
        given = self.end_touching
        return () if given is None else (given,) if isinstance(given, str) else tuple(given)

    @property
    def limits(self) -> Limits:
        """Settings as the kernel takes them: numbers alone, and so without the parts of ``end_touching``."""
        return Limits(
            max_time=self.max_time,
            max_steps=_MOST_STEPS,
            tolerance=self.tolerance,
            sample_interval=self.sample_interval,
            max_rebounds=float(self.max_rebounds),
            end_on_chord=1.0 if self.end_on_chord else 0.0,
            end_parts=0.0,
            run_out=self.run_out,
            most_work=WORK,
            shortest_flight=0.0,
        )


class Fields(TypedDict, total=False):
    """Fields of :class:`Settings` that a call spells; one that is None is as if it were not given."""

    solver: Solver | None
    max_time: float | None
    max_rebounds: int | None
    end_on_chord: bool | None
    end_touching: str | Sequence[str] | None
    run_out: float | None
    settle_speed: float | None
    tolerance: float | None
    sample_interval: float | None


DEFAULT: Final = Settings()


def changed(settings: Settings | None, **fields: Unpack[Fields]) -> Settings:
    """Return settings, the default ones for None, with some fields in place of theirs; raises as :class:`Settings`."""
    settings = checked_settings(settings)
    wrong = [name for name in fields if name not in vars(settings)]
    if wrong:
        raise TypeError(f"{wrong[0]}: is no field of Settings; it has {', '.join(vars(settings))}")
    given: dict[str, Any] = {name: value for name, value in fields.items() if value is not None}
    return Settings(**vars(settings) | given) if given else settings


def checked_settings(settings: Settings | None) -> Settings:
    """Return settings, the default ones for None, or raise TypeError."""
    if settings is None:
        return DEFAULT
    if not isinstance(settings, Settings):
        raise TypeError(f"settings = {settings!r}: must be Settings, such as Settings(solver='rigid')")
    return settings
