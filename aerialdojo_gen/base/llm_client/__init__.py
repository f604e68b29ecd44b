"""A client of language models' services: bounded requests, refusals in plain words, pictures."""
