"""Mutation fuzzing of everything that reads a file or an answer from outside; `python -m fuzzing --help`."""
