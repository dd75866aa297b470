"""The guide's screenshots that are kept are small; tests/studies/test_guide_runs.py takes them anew."""

from pathlib import Path

from report_samples.screenshots import FOLDER

KEPT = sorted((Path(__file__).resolve().parents[3] / FOLDER).glob("*.png"))
MOST_BYTES = 150_000


def test_kept_screenshots_are_small() -> None:
    assert KEPT
    large = [picture for picture in KEPT if picture.stat().st_size > MOST_BYTES]
    assert {picture.name: picture.stat().st_size for picture in large} == {}
