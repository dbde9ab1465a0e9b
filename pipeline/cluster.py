"""Where batches run: a dask client of the kind the configuration names."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster

from pipeline.config import Cluster, DataError
from pipeline.output import complain

_SETTINGS = {
    # nobody looks at its samples, and every one of them stops all threads
    "distributed.worker.profile.enabled": False,
    "distributed.comm.timeouts.connect": "10s",
    # the experiment, some 60 MB, is the argument of a task
    "distributed.admin.large-graph-warning-threshold": "1 GB",
}
_WORKER_TIMEOUT_S = 30


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
        If a scheduler does not answer or has no workers, or dask-jobqueue is missing.
    """
    with dask.config.set(_SETTINGS):
        if cluster.kind == "scheduler":
            with _connect(cluster) as connected:
                yield connected
        else:
            with _start(cluster) as started, Client(started) as connected:
                if cluster.kind == "slurm":
                    complain(["waiting for SLURM to start a job"])
                    connected.wait_for_workers(1)
                yield connected


def _connect(cluster: Cluster) -> Client:
    where = f"cluster.address = {cluster.address}"
    try:
        connected = Client(cluster.address)
    except OSError:
        raise DataError(f"{where}: no scheduler answers") from None
    except TypeError:  # what distributed says of TLS without certificates
        raise DataError(f"{where}: tls needs certificates in dask's own configuration") from None
    try:
        connected.wait_for_workers(1, timeout=_WORKER_TIMEOUT_S)
    except TimeoutError:
        connected.close()
        raise DataError(f"{where}: the scheduler has no workers") from None
    return connected


def _start(cluster: Cluster):
    if cluster.kind == "slurm":
        jobs = slurm(cluster)
        jobs.scale(jobs=cluster.workers)
        return jobs
    return LocalCluster(
        processes=cluster.kind == "processes",
        n_workers=cluster.workers if cluster.kind == "processes" else 1,
        threads_per_worker=1 if cluster.kind == "processes" else cluster.workers,
        dashboard_address=None,
        host="127.0.0.1" if cluster.kind == "processes" else None,
    )


def slurm(cluster: Cluster):
    """SLURM jobs of one worker each, none submitted yet.

    Raises
    ------
    DataError
        If dask-jobqueue is not installed.
    """
    try:
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError:
        raise DataError("cluster = slurm: needs dask-jobqueue, pip install -e '.[slurm]'") from None
    return SLURMCluster(
        queue=cluster.queue,
        account=cluster.account,
        cores=cluster.cores,
        processes=1,
        memory=cluster.memory,
        walltime=cluster.walltime,
        scheduler_options={"dashboard_address": None},
    )
