"""Web pages on the local machine: what `view` and `annotate` share."""
