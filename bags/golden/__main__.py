"""`python -m bags.golden [FOLDER]`: record the golden bags again."""

import sys
from pathlib import Path

from bags.golden.runs import record_golden

record_golden(*(Path(folder) for folder in sys.argv[1:2]))
