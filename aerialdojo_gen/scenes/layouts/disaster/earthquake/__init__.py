"""A town after an earthquake: a square among fallen blocks of flats, or an old town of masonry on a hill."""
