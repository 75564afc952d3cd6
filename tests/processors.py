"""A worker of the tests keeps to one processor: its copies and threads would only take it from the other workers.

What has to be the same on any number of processors asks for all of them.
"""

import os

ALL = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()


def keep_to_one(worker):
    """Keep the worker ``gw<number>`` and all that it starts to one processor, and its linear algebra to one thread."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if ALL and worker:
        os.sched_setaffinity(0, {sorted(ALL)[int(worker.removeprefix("gw")) % len(ALL)]})


def use_all():
    """Use every processor again, for instance at the start of another process (``preexec_fn``)."""
    if ALL:
        os.sched_setaffinity(0, ALL)


def with_threads(count):
    """What ``subprocess.run`` is given for a process on every processor with so many threads, a number as text."""
    env = os.environ | {"OMP_NUM_THREADS": count, "OPENBLAS_NUM_THREADS": count}
    return {"env": env, "preexec_fn": use_all if ALL else None}  # Windows has no such function
