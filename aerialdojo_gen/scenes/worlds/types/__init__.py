"""The generators, one module a type: each has a function `write` that writes a world's plan into a draft."""
