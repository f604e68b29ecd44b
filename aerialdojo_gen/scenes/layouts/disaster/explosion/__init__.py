"""A place after an explosion: an industrial yard about a crater, or a street of torn fronts."""
