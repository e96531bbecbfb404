"""SledDescent: choose the launch, then trim the spin at every rebound on the way down."""

from __future__ import annotations

from sledenv.envs.episodes import DescentEpisodes
from sledenv.envs.launch import SledLaunch


class SledDescent(SledLaunch):
    """A sled on its way down, one hop a step: first the launch, then a trim of the spin at every rebound.

    Observation
        ``Box(-1, 1, (20,), float32)``: the context as in :class:`SledLaunch`, then the flight, all 0
        before the launch: progress, sine and cosine of the orientation, velocity along and off the slope, spin, spin
        lent by the rider's rotor, time and number of rebounds; scaled as docs/environments.md says.
    Action
        ``Box(-1, 1, (k + 1,), float32)``: the launch as in :class:`SledLaunch`, then the trim. The first step uses
        the launch alone and follows the descent to its first rebound; every other one uses the trim alone: the spin
        that the rider's rotor lends to the body until the next rebound, scaled by the bound of the scenario. A
        scenario without a rider ignores it.
    Reward
        That of the whole descent in the last step, 0 before; the work of the trims counts as energy supplied. Without
        any trim the return is the reward of :class:`SledLaunch`, bit for bit.
    Ending
        Terminated when the sled finishes or jams, and where the rules of the scenario say so, such as where the rider
        touches; truncated at a limit of the scenario.
    Info
        As for :class:`SledLaunch`, of the descent so far.

    Parameters
    ----------
    scenario, control, render_mode, solver, split, launch_noise, observe, info
        As for :class:`SledLaunch`; the window shows each hop as it is made.
    """

    _kind = DescentEpisodes
