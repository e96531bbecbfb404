"""Benchmarks of sledenv, one module a question, each with its peers in the same interleaved run."""
