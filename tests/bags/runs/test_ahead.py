"""Working ahead in another process."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from bags.runs.ahead import ahead

ALONE = """
import os
from bags.runs.ahead import ahead

def squares():
    for number in range(5):
        yield number * number, os.getpid()

def fails():
    yield 1
    raise ValueError("on purpose")

items = list(ahead(squares))
assert [square for square, _ in items] == [0, 1, 4, 9, 16]
assert {pid for _, pid in items} != {os.getpid()}
try:
    list(ahead(fails))
except ValueError as error:
    assert str(error) == "on purpose"
else:
    raise SystemExit("no error came through")
first = ahead(squares)
next(first)
first.close()
print("ok")
"""


def test_a_process_with_one_thread_gets_items_and_errors_from_another() -> None:
    """Items come in order from another process, so does an error; leaving early leaves nothing behind."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout) == (0, "ok\n"), done.stderr


def test_an_error_comes_through_wherever_it_runs() -> None:
    """With several threads the iterator runs in place: same items, same errors."""

    def fails() -> Iterator[int]:
        yield 1
        raise ValueError("on purpose")

    items = ahead(fails)
    assert next(items) == 1
    with pytest.raises(ValueError, match="on purpose"):
        next(items)
