#!/bin/sh
# What became of Slurm's job $1, in the words that Snakemake expects: success, failed or running. Asks the controller
# or, where that has forgotten the job, the accounts; of a failed job, says also where its log is. No answer at all
# means that Slurm is out of reach for now, not that the job has failed.
state=$(squeue --noheader --states=all --format=%T --jobs="$1" 2>&1) ||
    state="$(sacct --noheader --allocations --format=State%20 --jobs="$1" 2>/dev/null) $state"
case "$state" in
*COMPLETED*) echo success ;;
*FAIL* | *CANCELLED* | *TIMEOUT* | *OUT_OF_ME* | *DEADLINE* | *PREEMPTED* | *"Invalid job id"*)
    echo "Slurm job $1: $state (log: .snakemake/slurm/$1.log)" >&2
    echo failed
    ;;
*) echo running ;;
esac
