"""How kernels are compiled and kept, and straight-line programs; imports machine/, numba and numpy."""
