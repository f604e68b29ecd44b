"""One module a stage; what a stage is stands in `aerialdojo_gen.pipeline.stage`."""
