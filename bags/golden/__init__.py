"""Small recorded runs with their expected results; `python -m bags.golden` records them again."""

from bags.golden.examples import EXAMPLES
from bags.golden.runs import GOLDEN, expected_of, golden_path, record_golden

__all__ = ["EXAMPLES", "GOLDEN", "expected_of", "golden_path", "record_golden"]
