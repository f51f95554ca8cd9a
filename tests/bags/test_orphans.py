"""No process outlives the one that started it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import psutil
import pytest

if TYPE_CHECKING:
    from pathlib import Path

PARENT = """
import multiprocessing, os, signal, sys, time
from bags.orphans import die_with
def child(parent, number):
    die_with(parent, number)
    print(os.getpid(), flush=True)
    time.sleep(60)
if __name__ == "__main__":
    context = multiprocessing.get_context("fork")
    context.Process(target=child, args=(os.getpid(), signal.Signals(int(sys.argv[1])))).start()
    time.sleep(60)
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("ignored", [False, True])
def test_a_child_ends_with_its_parent(tmp_path: Path, number: signal.Signals, *, ignored: bool) -> None:
    """However the parent dies, and even where a shell has had SIGINT ignored."""
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN if ignored else signal.SIG_DFL)
    try:
        command = [sys.executable, str(script), str(int(number))]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as parent:
            assert parent.stdout is not None
            child = psutil.Process(int(parent.stdout.readline()))
            parent.kill()
            child.wait(timeout=30.0)
    finally:
        signal.signal(signal.SIGINT, before)
    assert not child.is_running()
