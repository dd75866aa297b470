"""Where a recording's page leads: only to pages that there are, by addresses that a browser understands."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote, urljoin

import pytest

from shukotsu.schemas.results import Results
from shukotsu.schemas.study import read_study
from shukotsu.stages.report.links import Link, Navigation, navigation
from shukotsu.stages.report.study_results import StudyResults

ODD = "Ä%2F é#?"
SHEET = [
    ("S1", "right", "opposition", "", "both", ""),
    ("S1", "left", "opposition", "", "evaluation", ""),
    ("S1", "right", "rom", "", "calibration", ""),
    ("S1", "left", "pinch", "2", "evaluation", ""),
    (ODD, "right", "opposition", "", "evaluation", ""),
    (ODD, "left", "opposition", "", "evaluation", "hand moved"),
    ("S3", "left", "opposition", "", "evaluation", ""),
    ("S4", "right", "opposition", "", "evaluation", ""),
    ("S6", "left", "pinch", "1", "evaluation", ""),
    ("S6", "left", "pinch", "2", "evaluation", ""),
    ("S6", "right", "pinch", "2", "evaluation", ""),
    ("S6", "right", "pinch", "3", "evaluation", ""),
]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> StudyResults:
    folder = tmp_path_factory.mktemp("study")
    lines = ["subject\thand\ttask\ttrial\trole\texclude\tfile"]
    lines += ["\t".join([*row[:5], row[5], f"{n}.csv"]) for n, row in enumerate(SHEET)]
    (folder / "sheet.tsv").write_text("\n".join(lines) + "\n", "utf-8")
    text = "study: odd\nrecordings: sheet.tsv\nlayout: liberty16\nmodels: [rigid]\n"
    (folder / "study.yaml").write_text(text, "utf-8")
    recordings = read_study(folder / "study.yaml").recordings
    no_rows: list[list[Any]] = [[] for _ in range(12)]
    return StudyResults("odd", recordings, False, Results(Path("/r/odd")), {}, {}, *no_rows)


def of(study: StudyResults, subject: str, hand: str, name: str) -> Navigation:
    (recording,) = [r for r in study.shown if (r.hand.subject, r.hand.hand, r.name) == (subject, hand, name)]
    return navigation(study, recording)


def leads_to(link: Link | None, page: str) -> str:
    """The file that a browser opens for the link on a page of /r/odd/report."""
    assert link is not None
    return unquote(urljoin(f"http://x/r/odd/report/{page}", link.href)).removeprefix("http://x")


def test_the_links_of_a_page_lead_where_the_pages_are(study: StudyResults) -> None:
    to = of(study, "S1", "right", "opposition")
    page = "sub-S1/right/opposition.html"
    assert leads_to(to.study, page) == "/r/odd/report.html"
    assert leads_to(to.subject, page) == "/r/odd/report/sub-S1/subject.html"
    assert leads_to(to.other_hand, page) == "/r/odd/report/sub-S1/left/opposition.html"
    assert to.other_hand is not None
    assert to.other_hand.words == "Left hand"
    assert [leads_to(other, page) for other in to.others] == [
        "/r/odd/report/sub-S1/left/opposition.html",
        "/r/odd/report/sub-S1/left/pinch_2.html",
    ]
