"""Computes the cells of a study on Dask distributed: on whatever scheduler there is, or on one of our own here."""

import logging
import re
import signal
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from itertools import islice
from pathlib import Path

from distributed import Client, Future, KilledWorker, LocalCluster, as_completed

from bags.study.cells import StudyCell
from bags.study.errors import StudyError
from bags.study.evaluate import evaluate
from bags.study.parts import Parts, as_part
from bags.study.pool import check_lost, named
from monitor.errors import MonitorError

_AHEAD = 500  # cells that the scheduler knows at a time: enough to grow by, few enough to hold
_ANSWER_SEC = 10.0
_SAME_BYTES = ("dcmg", "numpy", "scipy", "pyarrow")  # what the bytes of a part depend on
_LOCAL = "local"
_ADDRESS = re.compile(r"(tcp|tls|ucx|wss?)://\S+:\d+")


@dataclass(frozen=True, slots=True)
class DaskPool:
    """A Dask cluster: workers come and go, and the bytes of the parts come here.

    Attributes:
        client: Of the cluster's scheduler; whoever made it closes it.
    """

    client: Client

    def compute(self, cells: Sequence[StudyCell], parts: Parts, say: Callable[[str], object]) -> Iterator[StudyCell]:
        """See `Pool`."""
        waiting, lost, running = iter(cells), Counter[str](), dict[str, StudyCell]()
        done = as_completed(loop=self.client.loop)

        def submit(cell: StudyCell) -> None:
            key = f"dcmg-study-{cell.key}-{lost[cell.key]}"  # a failed key would be remembered
            running[key] = cell
            done.add(self.client.submit(_part_of, cell, _versions(), key=key, pure=False))

        if cells and not self.client.nthreads():
            say("no worker yet: waiting for one")
        for cell in islice(waiting, _AHEAD):
            submit(cell)
        for future in done:
            cell = running.pop(future.key)
            part = _answer(future, cell)
            if part is None:
                lost[cell.key] += 1
                check_lost(cell, lost[cell.key])
                say(f"{named(cell)}: its worker was killed again and again: computed again")
                submit(cell)
                continue
            parts.write(cell.key, part)
            yield cell
            for following in islice(waiting, 1):
                submit(following)


@contextmanager
def dask_pool(where: str) -> Iterator[DaskPool]:
    """Connect to a scheduler, for as long as the context lasts.

    Args:
        where: Its address, `tcp://HOST:PORT` or `tls://HOST:PORT`; the file that `dask scheduler --scheduler-file`
            writes; or `local` or `local:N`: N processes (one a core) on this machine, gone with the context.

    Raises:
        StudyError: There is none.
    """
    if where.split(":", maxsplit=1)[0] == _LOCAL:
        with _local_cluster(where) as cluster, Client(cluster, set_as_default=False) as client:
            yield DaskPool(client)
        return
    with _connected(where) as client:
        yield DaskPool(client)


def _local_cluster(where: str) -> LocalCluster:
    """Processes that talk over loopback alone, and draw nothing for a browser."""
    _, colon, count = where.partition(":")
    if colon and not (count.isdecimal() and int(count)):
        raise StudyError(f"{where}: expected {_LOCAL} or {_LOCAL}:N with a number N of processes")
    return LocalCluster(
        n_workers=int(count) if colon else None,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",  # not 8787, which another cluster may have
        silence_logs=logging.CRITICAL,
        preload=[__name__],
    )


def dask_setup(_: object) -> None:
    """Called by Dask in each worker process of a cluster of ours, which ends it: Ctrl-C reaches the whole group."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _connected(where: str) -> Client:
    is_address = _ADDRESS.fullmatch(where) is not None
    if not is_address and not Path(where).is_file():
        raise StudyError(
            f"{where}: expected the address of a Dask scheduler (tcp://HOST:PORT), its file, or {_LOCAL}[:N]"
        )
    told = {"address": where} if is_address else {"scheduler_file": where}
    try:
        return Client(**told, timeout=_ANSWER_SEC, set_as_default=False)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise StudyError(f"{where}: no Dask scheduler answers: {str(error).splitlines()[0]}") from error


def _versions() -> dict[str, str]:
    return {name: metadata.version(name) for name in _SAME_BYTES}


def _part_of(cell: StudyCell, wanted: Mapping[str, str]) -> bytes:
    """Do the work of a cell, at a worker.

    Raises:
        StudyError: The worker would give other bytes.
        monitor.errors.MonitorError: Wrong options of the observer.
    """
    for name, found in _versions().items():
        if found != wanted[name]:
            raise StudyError(f"a worker has {name} {found}, expected {wanted[name]} as here, for the same bytes")
    return as_part(cell.key, evaluate(cell))


def _answer(future: Future[bytes], cell: StudyCell) -> bytes | None:
    """The part of a cell; None: the workers that had it were killed.

    Raises:
        StudyError: There is none.
    """
    try:
        part: bytes = future.result()
    except KilledWorker:
        return None
    except StudyError:
        raise
    except MonitorError as error:
        raise StudyError(f"{named(cell)}: {error}") from error
    except CancelledError as error:
        raise StudyError(f"{named(cell)}: its Dask scheduler is gone: start again to go on") from error
    except (OSError, ImportError, RuntimeError) as error:  # a worker without dcmg, a scheduler that does not answer
        reason = str(error.__cause__ or error).splitlines()[0]
        raise StudyError(f"{named(cell)}: Dask cannot compute it: {reason}: start again to go on") from error
    return part
