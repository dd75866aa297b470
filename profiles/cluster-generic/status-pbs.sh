#!/bin/sh
# What became of PBS's job $1, in the words that Snakemake expects: success, failed or running. Asks for the history
# of finished jobs (-x) or, of Torque, for what it still keeps; of a failed job, says also where its log is. No answer
# at all means that PBS is out of reach for now, not that the job has failed.
job=$(qstat -x -f "$1" 2>&1 || qstat -f "$1" 2>&1)
case "$job" in
*"job_state = "[FC]*xit_status\ =\ 0*) echo success ;;
*"job_state = "[FC]* | *"Unknown Job"*)
    echo "PBS job $1 failed (log: in .snakemake/pbs)" >&2
    echo failed
    ;;
*) echo running ;;
esac
