"""Compiled mechanics: numbers in, numbers out, no Python objects and no input or output."""
