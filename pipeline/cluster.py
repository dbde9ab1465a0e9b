"""Where batches run: a dask client of the kind the configuration names."""

from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster

from pipeline.config import Cluster, DataError

_QUIET = {"distributed.logging.distributed": "error", "distributed.comm.timeouts.connect": "10s"}


@contextmanager
def client(cluster: Cluster) -> Iterator[Client]:
    """Connect to, or start, the workers.

    Parameters
    ----------
    cluster : Cluster

    Yields
    ------
    distributed.Client

    Raises
    ------
    DataError
        If a scheduler does not answer, or dask-jobqueue is missing.
    """
    with dask.config.set(_QUIET):
        if cluster.kind == "scheduler":
            try:
                connected = Client(cluster.address)
            except OSError:
                raise DataError(f"cluster.address = {cluster.address}: no scheduler answers") from None
            with connected:
                yield connected
            return
        with _start(cluster) as started, Client(started) as connected:
            yield connected


def _start(cluster: Cluster):
    if cluster.kind == "slurm":
        return slurm(cluster)
    return LocalCluster(
        processes=cluster.kind == "processes",
        n_workers=cluster.workers if cluster.kind == "processes" else 1,
        threads_per_worker=1 if cluster.kind == "processes" else cluster.workers,
        dashboard_address=None,
        host="127.0.0.1" if cluster.kind == "processes" else None,
    )


def slurm(cluster: Cluster):
    """SLURM jobs of workers.

    Raises
    ------
    DataError
        If dask-jobqueue is not installed.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise DataError("cluster = slurm: needs dask-jobqueue, pip install -e '.[slurm]'") from None
    jobs = SLURMCluster(
        queue=cluster.queue,
        account=cluster.account,
        cores=cluster.cores,
        processes=1,
        memory=cluster.memory,
        walltime=cluster.walltime,
        scheduler_options={"dashboard_address": None},
    )
    jobs.scale(jobs=cluster.workers)
    return jobs
