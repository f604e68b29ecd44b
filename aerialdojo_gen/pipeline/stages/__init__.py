"""What stages do: `work`, a module each, imported when the stage runs."""
