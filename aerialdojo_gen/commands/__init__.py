"""The commands, one module a group; each holds a Typer ``app`` that `aerialdojo_gen.cli` takes in."""
