"""Tables of a descent for other programs, columns named with their units: what is written here ``identify`` reads."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent, ground_name
from sledenv.simulation.records import CONTACT_LOSSES
from sledenv.simulation.words import mode_name, part_name

# Fields of TRAJECTORY and how a table calls them; parts of the body are written as words.
TRAJECTORY_COLUMNS: Final = {
    "t": "t_s",
    "x": "x_m",
    "y": "y_m",
    "phi": "phi_rad",
    "u": "u_m_s",
    "v": "v_m_s",
    "omega": "omega_rad_s",
    "normal": "normal_n",
    "tangential": "tangential_n",
    "rolling": "rolling_n_m",
    "feature": "feature",
    "slip": "slip_sign",
    "spin": "spin_sign",
    "touching": "contacts",
}
# Of CONTACT_FORCES, a column for the first contact of a row, one for the second and so on, see trajectory_columns.
CONTACT_COLUMNS: Final = {
    "x": "x_m",
    "y": "y_m",
    "normal_x": "normal_x",
    "normal_y": "normal_y",
    "normal": "normal_n",
    "tangential": "tangential_n",
    "part": "part",
    "ground": "ground",
}
# Of REBOUND; ``phi_rad`` is not among them, see rebound_columns.
REBOUND_COLUMNS: Final = {
    "t_touchdown": "t_touchdown_s",
    "x_contact": "x_contact_m",
    "u_before": "u_before_m_s",
    "v_before": "v_before_m_s",
    "omega_before": "omega_before_rad_s",
    "u_after": "u_after_m_s",
    "v_after": "v_after_m_s",
    "omega_after": "omega_after_rad_s",
    "t": "t_end_s",
    "x": "x_end_m",
    "phi": "phi_end_rad",
    "duration": "duration_s",
    "feature": "feature",
    "ground": "ground",
    "mode": "mode",
    "normal_impulse": "normal_impulse_n_s",
    "tangential_impulse": "tangential_impulse_n_s",
    "rolling_impulse": "rolling_impulse_n_m_s",
    "peak_force": "peak_force_n",
    "peak_penetration": "peak_penetration_m",
    **{f"loss_{name}": f"loss_{name}_j" for name in CONTACT_LOSSES},
}


def trajectory_columns(descent: Descent) -> dict[str, list[Any]]:
    """Return the table of a trajectory: the cells of each column by its name, in SI units.

    Where as many as two contacts touch at once, there are columns of a first and of a second one, ``contact_1_x_m`` to
    ``contact_2_ground``; so for any number. Cells are None where there is no such contact.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``; the columns are empty otherwise.
    """
    columns = {name: descent.trajectory[field].tolist() for field, name in TRAJECTORY_COLUMNS.items()}
    columns["feature"] = [part_name(descent.body, code) for code in columns["feature"]]
    for k in range(max(columns["contacts"], default=0)):
        there, one = descent.trajectory["touching"] > k, descent.trajectory["contacts"][:, k]
        for field, name in CONTACT_COLUMNS.items():
            cells: list[Any] = [None] * len(there)
            for i in np.flatnonzero(there).tolist():
                cells[i] = _word(descent.body, field, one[field][i].item())
            columns[f"contact_{k + 1}_{name}"] = cells
    return columns


def _word(body: Body, field: str, cell: Any) -> Any:
    """Return what a table says for a number of CONTACT_FORCES."""
    return part_name(body, cell) if field == "part" else ground_name(cell) if field == "ground" else cell


def rebound_columns(descent: Descent) -> dict[str, list[Any]]:
    """Return the table of the rebounds of a descent: the cells of each column by its name, in SI units.

    ``phi_rad`` is the orientation at touchdown [rad], where a contact begins, and follows from the spin of the flight
    before it: a record has that at the end of the contact, which is ``phi_end_rad`` here.
    """
    return rebound_rows(descent.rebounds, descent.body, descent.launch.phi)


def rebound_rows(rows: np.ndarray, body: Body, phi: float) -> dict[str, list[Any]]:
    """Return :func:`rebound_columns` of a log of rebounds, of a body and its orientation at the launch [rad]."""
    columns = {name: rows[field].tolist() for field, name in REBOUND_COLUMNS.items()}
    columns["feature"] = [part_name(body, code) for code in columns["feature"]]
    columns["ground"] = [ground_name(code) for code in columns["ground"]]
    columns["mode"] = [mode_name(code) for code in columns["mode"]]
    since, begun = np.append(0.0, rows["t"])[:-1], np.append(phi, rows["phi"])[:-1]
    landed = begun + rows["omega_before"] * (rows["t_touchdown"] - since)
    return {"t_touchdown_s": columns.pop("t_touchdown_s"), "phi_rad": landed.tolist(), **columns}
