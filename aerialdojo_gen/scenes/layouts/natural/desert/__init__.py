"""A desert: a sand sea or a canyon, layered rocks, tracks, an oasis, mud-brick houses, ruins, and people's camps."""
