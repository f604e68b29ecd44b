"""Numba's decorator for the functions of this package; how their machine code is kept, `kernel_cache` says."""

from __future__ import annotations

from numba import config, njit  # noqa: TID251 - all other modules take it from here

__all__ = ["njit"]

# Named, not imported: where machine code is kept changes nothing that a stage writes. Functions of other packages go
# where Numba puts them, and to our places where Numba finds none.
config.CACHE_LOCATOR_CLASSES = ",".join(
    (
        "aerialdojo_gen.base.kernel_cache.OwnKernels",
        config.CACHE_LOCATOR_CLASSES
        or "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator,ZipCacheLocator",
        "aerialdojo_gen.base.kernel_cache.Kernels",
    )
)
