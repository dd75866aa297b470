#!/bin/sh
# What became of SGE's job $1, in the words that Snakemake expects: success, failed or running. A job that has left
# qstat is in the accounts, some seconds later; of a failed one, says also where its log is.
if qstat -j "$1" >/dev/null 2>&1; then
    echo running
    exit
fi
case "$(qacct -j "$1" 2>&1)" in
*"exit_status  0"*) echo success ;;
*exit_status*)
    echo "SGE job $1 failed (log: in .snakemake/sge)" >&2
    echo failed
    ;;
*) echo running ;;
esac
