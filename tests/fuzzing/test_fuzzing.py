"""Damaged input comes out read or as InputError, and what does not is counted and kept."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from fuzzing.targets import FOLDER_OF_SEEDS, TARGETS, random_input, target

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("name", TARGETS)
def test_clean_inputs_inputs_that_failed_once_and_random_damage(name: str) -> None:
    count = 3 if "c3d" in name else 12
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ResourceWarning)
        assert target(name).check(target(name).seeds[0]) in ("read", "decoded", "refused")
        for data in (*target(name).seeds, *(random_input(name, 0, number) for number in range(count))):
            target(name).check(data)


@pytest.mark.parametrize("name", TARGETS)
def test_what_is_spoilt_is_sound_before(name: str) -> None:
    """Else the readers' first lines alone would be reached."""
    assert target(name).check(target(name).seeds[0]) in ("read", "decoded")


def test_every_stored_input_belongs_to_a_target_and_all_are_small() -> None:
    stored = [path for path in FOLDER_OF_SEEDS.rglob("*") if path.is_file()]
    assert {path.parent.name for path in stored} <= {name.replace(" ", "_") for name in TARGETS}
    assert 0 < sum(path.stat().st_size for path in stored) < 100_000


def test_an_input_is_the_same_every_time_and_not_the_original() -> None:
    one, again, other = (random_input("stream viper", 3, number) for number in (5, 5, 6))
    assert one == again
    assert len({*target("stream viper").seeds, one, other}) == 3


def fed(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments, the feeder importable."""
    paths = os.pathsep.join([str(REPOSITORY), str(REPOSITORY / "tests")])
    return subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | {"PYTHONPATH": paths},
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_random_damage_within_bounds(name: str) -> None:
    """`make fuzz inputs=N` feeds N to each target; an input that failed stays in failed-inputs/."""
    folder = REPOSITORY / "failed-inputs"
    folder.mkdir(exist_ok=True)
    inputs = max(1, round(int(os.environ.get("FUZZ_INPUTS", "100")) * target(name).share))
    end = fed("-m", "fuzzing.feed", name, str(inputs), os.environ.get("FUZZ_SEED", "1"), str(folder))
    assert end.returncode == 0, end.stderr[-4000:]
    if not any(folder.iterdir()):
        folder.rmdir()


PLANTED = """
import os
from pathlib import Path
from fuzzing import feed, targets

feed.LONGEST_S = 0.2
check = lambda data: data == b"bad" and {fails}
targets._TARGETS["planted"] = lambda: targets.Target((b"seed",), check, lambda *_: b"bad")
feed.feed("planted", 3, 1, Path({folder!r}))
"""


@pytest.mark.parametrize(
    "fails", ["os.kill(os.getpid(), 9)", "any(iter(int, 1))", "bytearray(2**33)", "1 / 0"]
)
def test_what_crashes_hangs_grows_or_raises_fails_and_its_input_is_kept(fails: str, tmp_path: Path) -> None:
    assert fed("-c", PLANTED.format(fails=fails, folder=str(tmp_path))).returncode != 0
    assert (tmp_path / "planted").read_bytes() == b"bad"
