"""Tools in the browser and pictures of tasks: annotate, view, show, and what they share."""
