"""An iterator that works ahead in a process of its own, so that a second core helps."""

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

Item = TypeVar("Item")

_TASKS = Path("/proc/self/task")


def ahead(make: Callable[[], Iterator[Item]]) -> Iterator[Item]:
    """Iterate over `make()`, which runs in a forked process as far ahead as the pipe between them holds.

    Forking is safe only where this process has a single thread; elsewhere the iterator runs here, with the same items.

    Args:
        make: Makes the iterator; its items must be picklable.

    Raises:
        Exception: Whatever the iterator raises.
    """
    if not _TASKS.is_dir() or len(list(_TASKS.iterdir())) > 1:
        yield from make()
        return
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(make, sender), daemon=True)
    process.start()
    sender.close()
    try:
        while True:
            more, item = receiver.recv()
            if not more:
                if item is not None:
                    raise item
                return
            yield item
    finally:
        receiver.close()
        process.terminate()
        process.join()


def _work(make: Callable[[], Iterator[Item]], sender: Connection) -> None:
    """Send (True, item) for every item, then (False, None), or (False, error)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the other process's to handle; it ends this one
    try:
        for item in make():
            sender.send((True, item))
        sender.send((False, None))
    except BrokenPipeError:
        pass  # nobody wants more
    except Exception as error:  # noqa: BLE001 (raised again where the items are wanted)
        sender.send((False, error))
