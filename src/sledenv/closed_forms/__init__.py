"""Closed forms: impacts of a wheel, where a body rests, tips and swings; imports simulation/."""

from typing import TYPE_CHECKING

from sledenv.machine.lazy import lazy_names

if TYPE_CHECKING:
    from sledenv.closed_forms.wheel import WheelImpact, collide_wheel

__all__ = ["WheelImpact", "collide_wheel"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "sledenv.closed_forms.wheel": ("WheelImpact", "collide_wheel"),
    },
)
