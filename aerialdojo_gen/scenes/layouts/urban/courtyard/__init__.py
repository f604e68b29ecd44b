"""A courtyard drawn by hand: walls, roofs on posts and props stand where the recipe says."""
