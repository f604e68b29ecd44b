"""Tables on the disk: schemas, places, shards, and writes that are whole or not there."""
