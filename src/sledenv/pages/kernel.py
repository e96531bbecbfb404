"""The kernel for pages: how it is linked as WebAssembly, and what it is given.

``python -m sledenv.pages.kernel`` writes the file kernel.wasm. It holds all that a script needs: layouts of records and
tuples travel in it as JSON, in a section of its own.
"""

from __future__ import annotations

import base64
import importlib.util
import json
import math
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from sledenv.compiler.entries import Table
from sledenv.machine.files import replacing
from sledenv.pages.as_json import plain_slope
from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import checked_descent, limits_of
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import (
    BODY,
    CONTACT_FORCES,
    GIVEN,
    LIBRARY,
    OUTCOME,
    PIECE,
    REBOUND,
    SCENE,
    SPACE,
    STATUS_OF_CODE,
    TRAJECTORY,
    params,
)
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import DEFAULT, Settings

KERNEL: Final = Path(__file__).with_name("kernel.wasm")
_SECTION: Final = "sledenv"
_ENTRIES: Final = ("descend_lanes", "embark", "judge", "complete", "build_pieces", "resting")
_RECORDS: Final = {
    "BODY": BODY,
    "CONTACT_FORCES": CONTACT_FORCES,
    "OUTCOME": OUTCOME,
    "PIECE": PIECE,
    "REBOUND": REBOUND,
    "SCENE": SCENE,
    "SPACE": SPACE,
    "TRAJECTORY": TRAJECTORY,
}
_TUPLES: Final = (params.ContactLaw, params.Slope, params.Zone, params.State, params.Limits, DescentJam)
_STACK: Final = 1 << 18  # bytes
_NO_LINKER = "needs the linker wasm-ld: pip install ziglang, or install lld (Debian: apt-get install lld)"


# What a script must know.


def layout() -> dict[str, Any]:
    """Return what a script must know of the kernel, made of the types that the kernel itself is compiled with.

    Returns
    -------
    dict
        ``records``: of each its ``size`` in bytes, and of each field its kind (i4, i8, f8, or the name of another one
        of the records), its offset in bytes and how many numbers or records it has. ``tuples``: names of the fields.
        ``entries``: kinds of the arguments, names of tuples, {"table": dimensions}, "float" or "int". ``arc``: what is
        given of each arc of a body. ``status``: names of the codes. ``limits``: those of the default settings.
    """
    return {
        "fingerprint": LIBRARY.fingerprint,
        "records": {name: _record(dtype) for name, dtype in _RECORDS.items()},
        "tuples": {kind.__name__: list(kind._fields) for kind in _TUPLES},
        "entries": {name: list(map(_kind, LIBRARY.entries[name].kinds)) for name in _ENTRIES},
        "arc": list(GIVEN),
        "status": list(map(str, STATUS_OF_CODE)),
        "limits": jsonable(DEFAULT.limits._asdict()),
    }


def _record(dtype: np.dtype) -> dict[str, Any]:
    """Return size and fields of a record, of those that hold numbers or records that a script knows."""
    known = {record: name for name, record in _RECORDS.items()}
    fields = {}
    for name, (of, offset, *_) in (dtype.fields or {}).items():
        kind = known.get(of.base) if of.base.names else of.base.str[1:]
        if kind:
            fields[name] = [kind, offset, math.prod(of.shape)]
    return {"size": dtype.itemsize, "fields": fields}


def _kind(kind: Any) -> Any:
    return {"table": kind.dimensions} if isinstance(kind, Table) else kind.__name__


def jsonable(value: Any) -> Any:
    """Return what JSON can hold: what is no finite number becomes a string, of which JavaScript makes a number."""
    match value:
        case dict():
            return {key: jsonable(entry) for key, entry in value.items()}
        case list() | tuple():
            return [jsonable(entry) for entry in value]
        case float() if not math.isfinite(value):
            return str(value).replace("inf", "Infinity").replace("nan", "NaN")
        case _:
            return value


def descent_input(
    body: Body, law: ContactLaw, slope: Slope, launch: State, settings: Settings = DEFAULT
) -> dict[str, Any]:
    """Return what ``Kernel.descend`` of ``templates/kernel.js`` takes, as JSON can hold it; numbers keep all digits.

    Parameters
    ----------
    body, law, slope, launch, settings
        As for :func:`sledenv.simulate`.

    Returns
    -------
    dict
        ``body`` (``mass`` [kg], ``inertia`` [kg m^2], ``drag_area`` [m^2], ``arcs``), ``law``, if surfaces are rigid
        with a ``settle_speed``, ``slope`` with its ``zones``, ``profile`` and
        ``rounding``, ``launch``, ``limits``, ``solver``.

    Raises
    ------
    TypeError, ValueError
        As :func:`sledenv.simulate`.
    """
    body, law, slope, launch, scenes = checked_descent(body, law, slope, launch, settings)
    record, settle = body.record[0], float(scenes.rows["settle_speed"][0])
    arcs = [{name: float(record[name][k]) for name in GIVEN} for k in range(int(record["count"]))]
    of_body = {name: float(record[name]) for name in ("mass", "inertia", "drag_area")}
    given = {
        "body": {**of_body, "arcs": arcs},
        "law": law._asdict() | ({"settle_speed": settle} if settings.solver == "rigid" else {}),
        "slope": plain_slope(slope),
        "launch": launch._asdict(),
        "limits": limits_of(body, settings)._asdict(),
        "solver": settings.solver,
    }
    plain: dict[str, Any] = jsonable(given)
    return plain


def packed_kernel() -> str:
    """Return the kernel as a page holds it: deflated, in base 64."""
    return base64.b64encode(zlib.compress(KERNEL.read_bytes(), 9)).decode("ascii")


# How the file is made, and read.


def sections(content: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield number, place and content of each section of a file of WebAssembly."""
    place = 8
    while place < len(content):
        kind = content[place]
        size, place = _number(content, place + 1)
        yield kind, place, content[place : place + size]
        place += size


def told(content: bytes) -> dict[str, Any]:
    """Return the layout that a file of the kernel holds.

    Raises
    ------
    ValueError
        If it holds none.
    """
    name = _named(_SECTION)
    for kind, _, section in sections(content):
        if kind == 0 and section.startswith(name):
            found: dict[str, Any] = json.loads(section[len(name) :])
            return found
    raise ValueError(f"no section {_SECTION!r}")


def _number(content: bytes, place: int) -> tuple[int, int]:
    """Return a number in LEB128, and the place behind it."""
    number = shift = 0
    while True:
        byte = content[place]
        number |= (byte & 127) << shift
        place, shift = place + 1, shift + 7
        if byte < 128:
            return number, place


def _leb(number: int) -> bytes:
    head = number & 127
    return bytes([head]) if number < 128 else bytes([head | 128]) + _leb(number >> 7)


def _named(name: str) -> bytes:
    return _leb(len(name)) + name.encode()


def make(file: Path = KERNEL) -> None:
    """Compile and link the kernel: two minutes.

    Raises
    ------
    RuntimeError
        If there is no linker, or if it fails.
    """
    linker = _linker()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        LIBRARY.make(scratch, "wasm32")
        (scratch / "kernel.o").write_bytes((scratch / "wasm32.kernel").read_bytes().partition(b"\n")[2])
        exported = [*(f"sledenv_{name}" for name in _ENTRIES), "__heap_base"]
        # Without an option for what is undefined, the linker refuses: the kernel asks nothing of whoever runs it.
        options = ["--no-entry", "--gc-sections", "--strip-all", "-O2", "--stack-first", "-z", f"stack-size={_STACK}"]
        command = [*linker, *options, *(f"--export={name}" for name in exported), "kernel.o", "-o", "kernel.wasm"]
        done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"the kernel could not be linked: {' '.join(command)}: {done.stderr.strip()[-2000:]}")
        linked = (scratch / "kernel.wasm").read_bytes()
        section = _named(_SECTION) + json.dumps(layout(), separators=(",", ":")).encode()
        with replacing(file, ".wasm") as part:
            part.write_bytes(linked + b"\0" + _leb(len(section)) + section)


def _linker() -> list[str]:
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "wasm-ld"]
    found = shutil.which("wasm-ld")
    if not found:
        raise RuntimeError(f"the kernel for pages {_NO_LINKER}")
    return [found]


if __name__ == "__main__":
    make(*map(Path, sys.argv[1:]))
