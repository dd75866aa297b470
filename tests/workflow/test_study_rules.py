"""What all rules share: Snakemake's limit of jobs per time span."""

import pytest
from snakemake.cli import get_argument_parser
from snakemake.scheduling.job_scheduler import JobRateLimiter

from shukotsu.workflow.study_rules import chosen_limit


@pytest.mark.parametrize(("words", "kept"), [([], False), (["--max-jobs-per-timespan", "5/1s"], True)])
def test_only_snakemakes_default_limit_is_switched_off(words: list[str], kept: bool) -> None:
    options = get_argument_parser().parse_args(words)
    limiter = JobRateLimiter(options.max_jobs_per_timespan)
    assert chosen_limit(limiter) is (limiter if kept else None)
