"""`python -m aerialdojo_gen.cli`: the command line without its script."""

from aerialdojo_gen.cli.app import main

main()
