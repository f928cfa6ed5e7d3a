"""Keeps a dask cluster of two workers up until standard input closes; prints its address and its workers."""

import sys

import dask
from distributed import LocalCluster

if __name__ == "__main__":
    # A worker that is slow to come back after it was killed would be given up for good after 15 s.
    dask.config.set({"distributed.deploy.lost-worker-timeout": "1 hour"})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, *(nanny.pid for nanny in cluster.workers.values()), flush=True)
        sys.stdin.read()
