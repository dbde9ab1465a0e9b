"""Where batches run: a dask client of the kind the configuration names."""

import asyncio
import logging
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from urllib.parse import urlsplit

import dask
import distributed.core
from dask.utils import parse_timedelta
from distributed import Client, LocalCluster, Security
from distributed.core import rpc

from pipeline.campaign.worker import say_nothing
from pipeline.config.schema import Cluster
from pipeline.console import interrupts
from pipeline.console.errors import DataError
from pipeline.console.output import complain

_SETTINGS = {
    # nobody looks at its samples, and every one of them stops all threads
    "distributed.worker.profile.enabled": False,
    # nor at how soon its loops come round, which they try fifty times a second
    "distributed.admin.tick.interval": "1s",
    "distributed.comm.timeouts.connect": "10s",
    # the experiment, some 60 MB, is the argument of a task
    "distributed.admin.large-graph-warning-threshold": "1 GB",
    # the driver finds out itself which run it was, and does it faster
    "distributed.scheduler.allowed-failures": 0,
    # a worker that ended is started again, which takes its time where the machine is busy
    "distributed.deploy.lost-worker-timeout": "10 minutes",
    # waiting for memory that nothing will free; what takes too much is ended
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}
_WORKER_TIMEOUT_S = 30
_STARTS = 3
# a scheduler serves HTTP even so; without an address on port 8787, and warns where that is taken
_LOOPBACK = "127.0.0.1"
_NO_DASHBOARD = {"dashboard": False, "dashboard_address": f"{_LOOPBACK}:0"}


def check(cluster: Cluster) -> None:
    """See before a campaign whether SLURM can be had.

    Where nothing can be submitted, the job script that would be is printed on standard output.

    Parameters
    ----------
    cluster : Cluster

    Raises
    ------
    DataError
        If dask-jobqueue or sbatch is missing.
    """
    if cluster.kind == "slurm" and shutil.which("sbatch") is None:
        with slurm(cluster) as jobs:
            print(jobs.job_script().strip())
        raise DataError(
            "cluster = slurm: no sbatch on this machine; "
            "the job script it would submit is on standard output"
        )


@contextmanager
def client(cluster: Cluster) -> Iterator[Client]:
    """Connect to, or start, the workers.

    Parameters
    ----------
    cluster : Cluster

    Yields
    ------
    distributed.Client
        With at least one worker.

    Raises
    ------
    DataError
        If a scheduler does not answer or has no workers, workers do not start, or dask-jobqueue is
        missing.
    """
    with dask.config.set(_SETTINGS), ExitStack() as stack:
        if cluster.kind != "scheduler":  # what ends a worker is said by the driver, in one line
            stack.enter_context(_silent("distributed.scheduler", "distributed.nanny"))
        try:
            if cluster.kind == "scheduler":
                connected = stack.enter_context(_connect(cluster))
            else:
                with interrupts.held():
                    connected = stack.enter_context(Client(stack.enter_context(_started(cluster))))
            if cluster.kind == "processes":
                connected.run(say_nothing, on_error="ignore")
            if cluster.kind == "slurm":
                where = (
                    "" if cluster.address else " on this machine, no cluster.address being given"
                )
                complain([f"waiting for SLURM to start a job{where}"])
                connected.wait_for_workers(1)
            yield connected
        finally:
            with interrupts.held():
                stack.close()
                _forget()


def _forget() -> None:
    """Clear the cache by which distributed holds on to closed schedulers and workers, if it has it.

    They hold the experiments of their campaigns, which one process may make many of.
    """
    cached = getattr(distributed.core, "_expects_comm", None)
    clear = getattr(cached, "cache_clear", None)
    if clear is not None:
        clear()


@contextmanager
def _silent(*names: str) -> Iterator[None]:
    loggers = [logging.getLogger(name) for name in names]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def _connect(cluster: Cluster) -> Client:
    address = cluster.address
    where = f"cluster.address = {address}"
    try:
        # asked first, for a client waits for ever where something else takes its connection
        answer = asyncio.run(asyncio.wait_for(_identity(address), _answer_timeout()))
    except (OSError, ValueError):
        raise DataError(f"{where}: no scheduler answers") from None
    except TypeError:  # what distributed says of TLS without certificates
        raise DataError(f"{where}: tls needs certificates in dask's own configuration") from None
    if answer.get("type") != "Scheduler":
        raise DataError(f"{where}: no scheduler answers") from None
    connected = Client(address)
    try:
        connected.wait_for_workers(1, timeout=_WORKER_TIMEOUT_S)
    except TimeoutError:
        connected.close()
        raise DataError(f"{where}: the scheduler has no workers") from None
    return connected


def _answer_timeout() -> float:
    return parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))


async def _identity(address: str | None) -> dict:
    tls = Security().get_connection_args("client")
    async with rpc(address, connection_args=tls) as remote:
        return await remote.identity()


def _started(cluster: Cluster):
    for left in reversed(range(_STARTS)):
        try:
            return _start(cluster)
        except (OSError, RuntimeError, TimeoutError) as error:
            if not left:
                raise DataError(
                    f"cluster.workers = {cluster.workers}: workers do not start ({error})"
                ) from None
    raise AssertionError


def _start(cluster: Cluster):
    if cluster.kind == "slurm":
        jobs = slurm(cluster)
        jobs.scale(jobs=cluster.workers)
        return jobs
    processes = cluster.kind == "processes"
    with interrupts.kept_from_children() if processes else nullcontext():
        return LocalCluster(
            processes=processes,
            n_workers=cluster.workers if processes else 1,
            threads_per_worker=1 if processes else cluster.workers,
            dashboard_address=None,
            # every worker serves HTTP as well: one that is a thread, without an address, to anybody
            worker_dashboard_address=None if processes else _NO_DASHBOARD["dashboard_address"],
            scheduler_kwargs=_NO_DASHBOARD,
            host=_LOOPBACK if processes else None,
        )


def slurm(cluster: Cluster):
    """SLURM jobs of one worker each, none submitted yet.

    Without an address they are looked for on this machine alone.

    Raises
    ------
    DataError
        If dask-jobqueue is not installed.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise DataError("cluster = slurm: needs dask-jobqueue, pip install -e '.[slurm]'") from None
    protocol, host, port = "tcp", _LOOPBACK, 0
    if cluster.address is not None:
        asked = urlsplit(cluster.address)
        protocol, host, port = asked.scheme, str(asked.hostname), asked.port or 0
    return SLURMCluster(
        queue=cluster.queue,
        account=cluster.account,
        cores=cluster.cores,
        processes=1,
        memory=cluster.memory,
        walltime=cluster.walltime,
        protocol=f"{protocol}://",
        security=Security() if protocol == "tls" else None,
        scheduler_options={**_NO_DASHBOARD, "host": host, "port": port},
        worker_extra_args=[
            *("--no-dashboard", "--dashboard-address", _NO_DASHBOARD["dashboard_address"]),
            *("--preload", "inscal.command"),  # where the pipeline is
            # a worker of another node has to be reached there; where that is, it knows itself
            *(("--host", _LOOPBACK) if cluster.address is None else ()),
        ],
    )
