"""Local web pages: what `view` and `annotate` share."""
