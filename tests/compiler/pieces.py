"""Program that loads the kernel where free address space comes in holes of some pages: ``python pieces.py PAGES``."""

import ctypes
import sys

from sledenv.kernel.entries import LIBRARY

PRIVATE, ANONYMOUS, UNRESERVED = 0x02, 0x20, 0x4000
WALL = 1 << 32  # bytes between two holes: further than an x86-64 reference reaches
HOLES = 64
memory = ctypes.CDLL(None)
memory.mmap.restype = ctypes.c_void_p
memory.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]
memory.munmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t]


def held(size: int) -> int:
    """Return the address of so many bytes that nobody else can have now."""
    address = memory.mmap(None, size, 0, PRIVATE | ANONYMOUS | UNRESERVED, -1, 0)
    if address in (None, ctypes.c_void_p(-1).value):
        print("no address space")  # a limit of the process
        sys.exit()
    return int(address)


lowest = held(WALL)
for size in (1 << bits for bits in range(30, 11, -1)):
    while (address := held(size)) > lowest:  # fills the holes that are there
        pass
    memory.munmap(address, size)
for _ in range(HOLES):
    hole = int(sys.argv[1]) << 12
    memory.munmap(held(WALL) + WALL - hole, hole)
LIBRARY.ready()
print(bool(LIBRARY.known()))
