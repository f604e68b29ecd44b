"""`validate`: a whole release checked again from its Parquet files and scene meshes alone."""

from aerialdojo_gen.dataset.validate.registry import Fault, Outcome
from aerialdojo_gen.dataset.validate.report import Report, write_report
from aerialdojo_gen.dataset.validate.run import ValidationOptions, validate

__all__ = ["Fault", "Outcome", "Report", "ValidationOptions", "validate", "write_report"]
