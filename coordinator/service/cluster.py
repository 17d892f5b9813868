"""An executor on a Dask cluster that a site has.

The scheduler keeps what tasks take, so a worker that dies costs time only: others do its tasks
again.  A value that many tasks take is sent once.  Workers with other software might find other
bytes, so each task looks at that first.

Decides: how a cluster is reached, and what a person is told when it fails.  Must not know: what is
computed.
"""

from __future__ import annotations

import asyncio
import functools
import hashlib
import logging
import pickle
import platform
import warnings
from collections.abc import Callable, Generator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final, ParamSpec, TypeVar

import numba
import numpy as np

from coordinator.base.errors import ClusterError, InputError
from coordinator.service.kernel_setup import get_kernels_ready

if TYPE_CHECKING:
    from distributed import Client

Given = ParamSpec("Given")
Found = TypeVar("Found")

_ROOT: Final = Path(__file__).parents[2]
_PACKAGES: Final = ("protocol", "coordinator", "robot_agent", "sim")

_PATIENCE_S: Final = 10.0
"""A cluster that has not answered after this time [s], or has no worker then, is not used."""

_SMALL: Final = 5_000
"""Values of fewer bytes are sent with each task."""


@contextmanager
def executor_on(address: str) -> Generator[Executor]:
    """Return a context with an executor on the cluster whose scheduler has this address.

    Raises InputError when there is none, and ClusterError when it fails before the work is done.
    """
    if find_spec("distributed") is None:
        raise InputError(
            ["--cluster: needs the package distributed: pip install 'splinefleet[dask]'"]
        )
    import dask
    from distributed import Client, KilledWorker
    from distributed.comm.core import CommClosedError

    # People are told what went wrong by this command, once.
    logging.getLogger("distributed").addFilter(_tells_nothing)
    logging.getLogger("distributed.client").addFilter(_tells_nothing)
    options = {
        "distributed.admin.large-graph-warning-threshold": "10GB",
        "distributed.comm.timeouts.connect": f"{_PATIENCE_S:g}s",
    }
    with dask.config.set(options):
        kind = asyncio.run(_kind_at(address))
        if kind != "Scheduler":
            raise InputError([f"--cluster: {address} is not the address of a scheduler: {kind}"])
        with warnings.catch_warnings(action="ignore"):
            client = Client(address, timeout=_PATIENCE_S, set_as_default=False)
        with client:
            try:
                client.wait_for_workers(1, timeout=_PATIENCE_S)
            except TimeoutError:
                raise InputError([f"--cluster: {address} has no worker"]) from None
            try:
                yield _Cluster(client)
            except ModuleNotFoundError as error:
                raise ClusterError(f"a worker of {address} has no module {error.name}") from None
            except KilledWorker as error:
                task = error.task
                raise ClusterError(f"{address}: workers died of the same task: {task}") from None
            except (CancelledError, CommClosedError):
                raise ClusterError(f"{address}: the scheduler is gone") from None


def _tells_nothing(_record: logging.LogRecord) -> bool:
    return False


async def _kind_at(address: str) -> str:
    """Return what answers at an address, or why nothing does."""
    from distributed import rpc

    try:
        async with asyncio.timeout(_PATIENCE_S), rpc(address) as there:
            return str((await there.identity())["type"])
    except TimeoutError:
        return f"no answer within {_PATIENCE_S:g} s"
    except Exception as error:  # Whatever is there may answer anything.
        return str(error).partition("\n")[0] or type(error).__name__


class _Cluster(Executor):
    """An executor that runs tasks on the workers of a client's cluster."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._executor = client.get_executor(pure=False)
        self._sent: dict[int, tuple[object, object]] = {}

    def submit(
        self, task: Callable[Given, Found], /, *args: Given.args, **kwargs: Given.kwargs
    ) -> Future[Found]:
        """Submit a task; its arguments must not change."""
        sent = [self._send(value) for value in args]
        named = {name: self._send(value) for name, value in kwargs.items()}
        future: Future[Found] = self._executor.submit(_run, software(), task, *sent, **named)
        return future

    def _send(self, value: object) -> object:
        """Return a value, or where the cluster has it.

        It goes there as the result of a task, since what is stored on workers alone is lost with
        them.
        """
        if id(value) in self._sent:
            return self._sent[id(value)][1]
        data = pickle.dumps(value)
        if len(data) < _SMALL:
            return value
        there = self._client.submit(pickle.loads, data, pure=False)
        self._sent[id(value)] = value, there
        return there

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more tasks; cancel those that are not done, unless they are waited for."""
        self._executor.shutdown(wait=wait and not cancel_futures)


def _run(
    wanted: str, task: Callable[Given, Found], *args: Given.args, **kwargs: Given.kwargs
) -> Found:
    """Run a task on a worker; raise ClusterError if its software is not the one wanted."""
    if (has := software()) != wanted:
        raise ClusterError(f"a worker has other software: {has}; needed: {wanted}")
    get_kernels_ready()
    return task(*args, **kwargs)


@functools.cache
def software() -> str:
    """Return what answers may depend on: versions, and a digest of this project's sources."""
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for source in sorted((_ROOT / package).rglob("*.py")):
            digest.update(source.read_bytes())
    versions = (platform.python_version(), np.__version__, numba.__version__)
    return "Python {}, numpy {}, numba {}, sources {}".format(*versions, digest.hexdigest()[:12])
