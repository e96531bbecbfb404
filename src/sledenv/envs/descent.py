"""SledDescent: trim the spin in every flight worth a decision on the way down."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Unpack

from sledenv.envs.episodes import DescentEpisodes
from sledenv.envs.info import INFO_KEYS
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import TaskOptions, check_options
from sledenv.scenarios.scenario import Scenario


class SledDescent(SledLaunch):
    """A ride: a sled on its way down, whose rider trims its spin in every flight that is long enough for it.

    Nobody chooses the launch: it is drawn with the context, from the ranges of the scenario or, where it gives none,
    from the control bounds. ``reset`` lets the sled go and follows it to its first flight of at least
    ``rider.shortest_flight_s``, that of the launch included. If none is so long, the descent has ended by then, and the
    first step, whose trim has no effect, returns all of its reward.

    Observation
        A Box, float32: the eleven fields of the context as in :class:`SledLaunch`, the flight that begins, the vertices
        around where there is a profile, and where the flight lands. docs/environments/descent.md lists the entries and
        how they are scaled; ``observation_names`` names them.
    Action
        ``Box(-1, 1, (1,), float32)``: the spin that the rider's rotor lends to the body in the coming flight, up to the
        next one that is long enough, scaled by the bound of the scenario. An unsteady rider (``rider.noise_rad_s``)
        lends it with an error, which belongs to the context. A scenario without a rider ignores it.
    Reward
        Half of what is gained in progress, and in the last step sqrt(retention) / 2. They add up to the reward of the
        whole descent, in which the work of the trims counts as energy supplied: without trims and errors to that of
        :class:`SledLaunch` for the same launch, whose descent is the same bit for bit.
    Ending
        Terminated when the descent ends, at a limit of the scenario too: the observation tells how far it is.
    Info
        As for :class:`SledLaunch`, of the descent so far; of a reset ``context`` and ``launch``.

    Parameters
    ----------
    scenario, render_mode, solver, split, launch_noise, observe, info
        As for :class:`SledLaunch`; the window shows each flight as it is made.
    """

    _kind = DescentEpisodes

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario = "sled_rollers",
        render_mode: str | None = None,
        *,
        info: Sequence[str] = INFO_KEYS,
        **task: Unpack[TaskOptions],
    ) -> None:
        check_options(type(self), task)
        super().__init__(scenario, None, render_mode, info=info, **task)
