"""Studies: many seeds x attacks x observers x detectors, offline, into one table and its curves."""

from bags.study.cells import StudyCell, cells_of, check_designs
from bags.study.dataset import tables_of
from bags.study.errors import StudyError
from bags.study.plan import Plan, plan_of
from bags.study.pool import LocalPool, Pool
from bags.study.run import run_study
from bags.study.settings import Study, load_study
from bags.study.summary import Comparison, OperatingPoint, compare, operating_points

__all__ = [
    "Comparison",
    "LocalPool",
    "OperatingPoint",
    "Plan",
    "Pool",
    "Study",
    "StudyCell",
    "StudyError",
    "cells_of",
    "check_designs",
    "compare",
    "load_study",
    "operating_points",
    "plan_of",
    "run_study",
    "tables_of",
]
