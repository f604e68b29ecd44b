"""A snowfield: a ski slope between valley and summit, or a research station out on the ice."""
