"""Benchmarks: error and time of methods side by side, as medians and ratios within one run."""

from psstereo.bench.environment import machine, peak_memory, versions
from psstereo.bench.problem import Problem
from psstereo.bench.record import SCHEMA, Record, read_records, write_records
from psstereo.bench.run import Summary, run_solvers, run_timed, summarise

__all__ = [
    "SCHEMA",
    "Problem",
    "Record",
    "Summary",
    "machine",
    "peak_memory",
    "read_records",
    "run_solvers",
    "run_timed",
    "summarise",
    "versions",
    "write_records",
]
