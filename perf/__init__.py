"""Benchmarks of sledenv: ``python -m perf peers``, ``env`` and ``versus``."""
