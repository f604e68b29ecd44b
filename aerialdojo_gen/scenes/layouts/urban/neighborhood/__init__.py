"""A neighbourhood: detached houses about a turning circle, or brick semis along a lane with a green."""
