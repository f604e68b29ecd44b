"""Annotation files: their format, the checks that they must pass, and drafts of new ones."""
