"""The command ``sledenv``, put together of its groups; a function is a sub-command, and its docstring is the help.

What a sub-command needs is imported where it runs, so that help is quick and completion too.
"""

from __future__ import annotations

from collections.abc import Sequence

from sledenv.command import benchmark, identification, installation, reproduction, simulation, uncertainty
from sledenv.command.running import app, run

command = app("sledenv", "Sled descents as repeated oblique impacts.")
command.register_install_completion_command(help="Install the completion of words in this shell.")

# In the order in which a shell and an unknown word are told of them.
command.command(simulation.simulate)
command.command(simulation.sensitivity)
command.command(simulation.scenarios)
command.command(simulation.replay)
command.command(simulation.play)
command.command(reproduction.reproduce)
command.command(benchmark.benchmark)
command.command(uncertainty.study)
command.command(benchmark.draw_map, name="map")
command.command(identification.identify)
command.command(installation.doctor)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with arguments, those of the command line by default, and return its exit status.

    See :func:`sledenv.command.running.run`.
    """
    return run(command, arguments)
