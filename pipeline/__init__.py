"""Monte Carlo pipeline around :mod:`inscal`: configuration, stages, stores, clusters."""

import os
import sys

# Runs are spread over the cores already, and the matrices are tiny: BLAS threads of their own would
# only fight for the same cores. To be set before numpy is imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# `python -m pipeline.<stage>` comes here before it imports numpy, dask and the like, for seconds.
if sys.argv[:1] == ["-m"]:
    from pipeline.console import help, interrupts

    help.answer_early()
    interrupts.begin()
