"""Run one echoset command on a Dask cluster of SLURM jobs, by dask-jobqueue.

    pip install 'echoset[cluster]' dask-jobqueue
    python slurm_cluster.py --jobs 40 -- estimate -e eopda-geo recordings/*.h5 -o estimates/

Queue, account and the like come from options or from ``~/.config/dask/jobqueue.yaml``. The jobs
end with the command, whose exit code is the script's; with ``--skip-existing`` it can be repeated.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

from dask_jobqueue import SLURMCluster


def main() -> int:
    """Keep the jobs running while the command does, replacing those lost; then cancel them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=10, help="number of SLURM jobs")
    parser.add_argument("--memory", default="2GB", help="of each job")
    parser.add_argument("--walltime", default="04:00:00", help="of each job")
    parser.add_argument("--interface", help="network of the nodes, such as ib0")
    parser.add_argument("command", nargs="+", help="arguments of echoset, after --")
    args = parser.parse_args()
    with SLURMCluster(
        cores=1,  # and so one worker a job: only then is a lost job replaced
        processes=1,
        memory=args.memory,
        walltime=args.walltime,
        interface=args.interface,
        # Workers would else import whatever lies in the folder that they are started in.
        job_script_prologue=["export OMP_NUM_THREADS=1 PYTHONSAFEPATH=1"],
        scheduler_options={"dashboard": False},
    ) as cluster:
        cluster.adapt(minimum_jobs=args.jobs, maximum_jobs=args.jobs)
        words = ["echoset", *args.command, "--cluster", cluster.scheduler_address]
        return subprocess.run(words).returncode


if __name__ == "__main__":
    sys.exit(main())
