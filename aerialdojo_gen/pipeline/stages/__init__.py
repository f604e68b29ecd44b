"""The stages: one module each, which declares what its stage reads, writes and depends on, and imports nothing heavy.

What a stage does stands in the module of the same name in `aerialdojo_gen.pipeline.stages.work`, their order in
`aerialdojo_gen.pipeline.registry`, and what a stage is in `aerialdojo_gen.pipeline.stage`.
"""
