"""A shopping mall: a hall about a courtyard, car park in front, loading yard behind, parking deck beside it."""
