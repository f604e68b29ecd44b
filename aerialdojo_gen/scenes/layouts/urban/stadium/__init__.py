"""A stadium: a football ground with stands all round, or an athletics ground with one main stand and grass banks."""
