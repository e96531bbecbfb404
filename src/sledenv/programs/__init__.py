"""How kernels are compiled, and the straight-line programs in them; no mechanics."""
