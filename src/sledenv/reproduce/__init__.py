"""Every number and figure of the paper, computed anew; imports closed_forms/, pages/, plot/ and simulation/."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from sledenv.machine.files import publish, write_csv
from sledenv.machine.text_tables import markdown
from sledenv.reproduce import cases
from sledenv.reproduce.claims import CLAIMS, of_example, of_jamming, of_sled, of_table_1, of_wheel
from sledenv.reproduce.euler import euler_descent

__all__ = ["FILES", "euler_descent", "reproduce"]


# What is written: part of the paper, and the name of its figure and of its table.
_PARTS: Final = (
    ("Fig. 2, equation (1), a wheel", "fig_2.png", "fig_2_4.csv"),
    ("Fig. 4, sliding stops", "fig_4.png", "fig_2_4.csv"),
    ("Fig. 7-10, the worked example", "fig_7_10.png", "fig_7_10.csv"),
    ("Fig. 11, the sled on an incline", "fig_11.png", ""),
    ("Fig. 12-14, its velocities", "fig_12_14.png", "fig_12_14.csv"),
    ("Table 1, the collision scenarios of a wheel", "table_1.png", "table_1.csv"),
    ("the same question for the eccentric body", "mode_map.png", "mode_map.csv"),
    ("jamming over orientation and spin", "jam_map.png", "jam_map.csv"),
    ("every number", "table.md", "table.csv"),
)
FILES: Final = ("index.md", *sorted({file for _, *files in _PARTS for file in files if file}))


def reproduce(folder: str | Path = "reproduction", *, progress: Callable[[str], None] = print) -> Path:
    """Compute everything quantitative in the paper and write it into one folder.

    Figures 2, 4, 7-10 and 11-14, Table 1 as a map, the modes of an eccentric impact, the map of jamming that the paper
    only announces, and a table of the paper's numbers and ours with the reason of each difference; docs/physics.md,
    section 2, derives the corrections.

    Parameters
    ----------
    folder : str or path
        Made anew in one move when all is complete. It may exist if it holds nothing but an earlier reproduction.
    progress : callable
        Called with one line before each part.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    OSError
        If the folder cannot be written or holds files of another origin; it is then left as it was.
    """
    from sledenv.reproduce import figures  # and with it matplotlib, which Euler's method does not need

    with publish(folder, FILES) as new:
        progress("Equation (1), figures 2 and 4: impacts of a wheel")
        straight = cases.disc_impact(0.0)
        oblique = {phase: cases.disc_impact(u0) for phase, u0 in cases.DISC_SPEEDS.items()}
        figures.write_wheel(new, straight, oblique)
        progress("Figures 7-10: the worked example, event-driven and by explicit Euler")
        example = cases.worked_example()
        figures.write_worked_example(new, example)
        progress("Figures 11-14: the sled hops down an incline")
        sled = cases.sled_descent()
        figures.write_sled(new, sled)
        progress("Table 1 as a map")
        figures.write_table_1(new)
        progress("Modes of an eccentric impact as a map")
        figures.write_mode_map(new)
        progress("Jamming over orientation and spin at the launch as a map")
        maps = {name: cases.jam_map(friction) for name, friction in cases.JAM_FRICTIONS.items()}
        figures.write_jam_map(new, maps)
        progress("Table of numbers")
        ours: dict[str, float | str] = {
            **of_wheel(straight, oblique),
            **of_example(example),
            **of_table_1(),
            **of_sled(sled),
            **of_jamming(maps),
        }
        _write_table(new, ours)
        _write_index(new, example)
    return Path(folder)


def _write_table(folder: Path, ours: Mapping[str, float | str]) -> None:
    write_csv(
        folder / "table.csv",
        ("id", "where", "quantity", "unit", "paper", "ours", "why"),
        ((*claim[:5], ours[claim.id], claim.why) for claim in CLAIMS),
    )
    cells = []
    for claim in CLAIMS:
        unit = "" if claim.unit == "-" else f" {claim.unit}"
        paper = f"{claim.paper}{unit}" if claim.paper.lstrip("-")[:1].isdigit() else claim.paper
        cells.append((claim.where, claim.quantity, paper, f"{ours[claim.id]:{claim.form}}{unit}", claim.why))
    table = markdown(("where", "quantity", "paper", "ours", "why they differ"), cells)
    (folder / "table.md").write_text(f"# The paper's numbers and ours\n\n{table}", encoding="utf-8")


def _write_index(folder: Path, example: cases.Example) -> None:
    def link(file: str) -> str:
        return f"[{file}]({file})" if file else ""

    parts = markdown(("part of the paper", "figure", "data"), ((part, *map(link, files)) for part, *files in _PARTS))
    euler, printed = (f"{run.energy.kinetic:.2f} J" for run in (example.euler, example.printed))
    paper = f"{cases.PRINTED_ENERGIES[1]:g} J"
    text = _INDEX.format(parts=parts, euler=euler, printed=printed, paper=paper, assumed=cases.SLED_ASSUMED)
    (folder / "index.md").write_text(text, encoding="utf-8")


_INDEX = """# The paper, computed anew

Source: *Analysis of oblique collision between parallel-plane moving constrained body and obstacle*. Written by
`sledenv reproduce`; all numbers were computed by that run.

{parts}
## What is corrected, and why

Sections are those of docs/physics.md, which derives each.

| in the paper | here | because | section |
|---|---|---|---|
| (10): friction has the moment -F (r - h cos φ) | +F (r - h cos φ) | with -F friction gives energy | 2.1 |
| worked example: V_y = -1 m/s and T(0) = 50 J | -10 m/s | m V_y²/2 = 50 J | 2.2 |
| worked example: T(0.04 s) = {paper} | {euler} | it follows from neither sign of friction | 2.2 |
| Fig. 9: the moment reverses in the first phase | in the second | that is what the equations give | 2.2 |
| (2), (3), (7): signs of friction and its moment | as in (10), corrected | a wheel would gain energy | 2.3 |
| Table 1: which scenario holds | rules of which exactly one holds | of the printed ones often several do | 2.4, 3 |

## Equation (1), Fig. 2 and Fig. 4

![Normal force of a straight impact with its two phases](fig_2.png)

![Normal and tangential force of oblique impacts in which sliding stops](fig_4.png)

The paper draws Fig. 2 and 4 without numbers. Ours: the contact of the worked example, a uniform disc, 1 m/s towards the
plane. Sliding stops in the first or in the second phase, depending on the velocity along the plane. Then the wheel
rolls, and rolling resistance asks for a small force within the bounds of friction.

## Fig. 7-10

![Forces, moment and kinetic energy of the worked example](fig_7_10.png)

m = 1 kg, r = 0.1 m, h = 0.05 m, J = 7.5e-3 kg m², f = 0.1, δ = 1 mm, c = 9.81 kN/m, Δ = 0.5, y = 0.07 m, φ = 45°, no
gravity, and V_y = -10 m/s, which T(0) = 50 J needs. Euler's method ends with T(0.04 s) = {euler} for the dissipative
sign of friction and {printed} for the printed one; the paper prints {paper}.

## Fig. 11-14

![The sled at equal intervals of time](fig_11.png)

![Velocities of the sled](fig_12_14.png)

{assumed}

## Table 1

![Scenarios of a wheel over speed ratio and friction](table_1.png)

On the left the corrected rules; on the right those of the printed rules that hold, hatched where there are several.
How often that is so, and how often exactly one corrected rule holds: [table.md](table.md).

## Eccentric body

![Modes of an eccentric impact over orientation and direction of approach](mode_map.png)

How one rigid impact of the worked example's body ends, without spin at touch.

## Jamming over orientation and spin

![Jam index over orientation and spin at the launch](jam_map.png)

The paper wants to predict jamming, and announces experiments with a sled. This is what its model says: the jam index
(docs/environments.md; 0 where all energy is kept to the end, 1 where the sled does not move) of the sled of Fig. 11,
let go in any orientation with any spin. Mass, restitution and the friction of ice are the paper's; the friction of the
rough slope is assumed, and all else as for Fig. 11.
"""
