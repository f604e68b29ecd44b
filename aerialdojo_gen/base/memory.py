"""How a process of ours collects garbage, and what it gives back of the memory that it has freed."""

import contextlib
import ctypes
import gc

# Of `mallopt` in the C library, <malloc.h>.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_BLOCK, _TOP = 4 << 20, 32 << 20


def set_up() -> None:
    """Look for garbage after 50,000 new objects, not 700, and give large blocks back to the system at once.

    Imports and catalogues make many objects, and hardly any garbage. By itself glibc keeps ever larger blocks in its
    heap once some were freed: arrays of one scene after the other then leave holes, and a process grows.
    """
    gc.set_threshold(50_000, 20, 20)
    with contextlib.suppress(AttributeError):  # a C library without it
        ctypes.CDLL(None).mallopt(_MMAP_THRESHOLD, _BLOCK)
        ctypes.CDLL(None).mallopt(_TRIM_THRESHOLD, _TOP)
