"""Faults of one run, for worker processes: dask runs this file in each of them as it starts.

The environment variable INSCAL_FAULT says which: ``kind:run``.
"""

import ctypes
import os
import time

from pipeline.campaign import worker

KIND, _, RUN = os.environ["INSCAL_FAULT"].partition(":")

_run = getattr(worker.run, "of_before", worker.run)  # dask may run this more than once


def faulty(experiment, runs, workspace):
    """As `inscal.experiment.run`, but for one run."""
    if int(RUN) in runs:
        fault()
    return _run(experiment, runs, workspace)


def fault():
    """Do what the fault is."""
    if KIND == "exit":
        raise SystemExit(3)
    if KIND == "end":
        os._exit(3)
    if KIND == "machine_code":
        ctypes.string_at(0)
    if KIND == "memory":  # all that the worker may have, and its keeper ends it
        taken = []
        while True:
            taken.append(bytearray(os.urandom(1 << 20)) * 64)
            time.sleep(0.02)
    if KIND == "never":
        time.sleep(1e6)


faulty.of_before = _run
worker.run = faulty
