"""Compiled mechanics: numbers in, numbers out, no Python objects, no input or output; imports compiler/ and numba."""
