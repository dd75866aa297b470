"""A study's outcome as plain text, for a terminal of 80 columns."""

from __future__ import annotations

import textwrap

from shukotsu.sentences.finding_sentences import in_quotes
from shukotsu.stages.report.headline import headline_lines
from shukotsu.stages.report.provenance import all_problems
from shukotsu.stages.report.study_results import StudyResults

WIDTH = 79
MOST_PROBLEMS = 3


def outcome_text(results: StudyResults) -> str:
    """Return the page's three numbers and its sentence, then the gravest problems with their cure."""
    problems = all_problems(results)
    lines = [f"Study {results.name}: {headline_lines(results)[0]}", *headline_lines(results)[1:]]
    lines += [
        f"- {problem.where}: {in_quotes(problem.text)} {problem.places}".rstrip()
        for problem in problems[:MOST_PROBLEMS]
    ]
    more = len(problems) - MOST_PROBLEMS
    lines += [f"- and {more} more; see the report"] if more > 0 else []
    return "\n".join(
        textwrap.fill(line, WIDTH, subsequent_indent="  ", break_on_hyphens=False) for line in lines
    )
