"""How stages run: what a stage is, their order, which shards are stale, executors, progress, Ctrl-C."""
