"""The command line: one thin command each, which calls a library function and prints."""
