"""Measure speed: ``python -m perf peers``, ``python -m perf env``, or two commits: ``python -m perf versus COMMIT``."""

from __future__ import annotations

import sys

from cyclopts import App

app = App("python -m perf", help="Measure speed.", version_flags=[])
app.command("perf.peers:measure", name="peers")
app.command("perf.env:measure", name="env")
app.command("perf.versus:versus")

if __name__ == "__main__":
    sys.exit(app())
