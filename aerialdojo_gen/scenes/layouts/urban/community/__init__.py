"""A residential community: a gated estate of flats about a garden, or terraced houses about shared allotments."""
