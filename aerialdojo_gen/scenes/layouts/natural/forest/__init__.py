"""A forest with a lived-in heart: a cabin, a camp, a fire tower, a pond, a ruin, and paths between them."""
