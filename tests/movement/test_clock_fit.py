"""Aligning two clocks by common pulses: offset, drift and their stated errors."""

from dataclasses import dataclass

import numpy as np
import pytest

from shukotsu.arrays import Array
from shukotsu.movement.recording_events import WAS_SET, ClockFit, fit_clock


@dataclass(frozen=True)
class Pulses:
    """Pulses as recorded by both clocks, and their true times on both."""

    reference_s: Array
    seen_s: Array
    true_s: Array
    other_s: Array

    def fit(self) -> ClockFit:
        """Return the fit, which must succeed."""
        fit = fit_clock(self.reference_s, self.seen_s)
        assert isinstance(fit, ClockFit), fit
        return fit

    def errors_s(self) -> tuple[Array, Array]:
        """Return the errors of all mapped pulse times and their stated sds, in s."""
        line = self.fit().line
        return line(self.other_s) - self.true_s, line.sd_s(self.other_s)


def simulated(
    seed: int,
    seconds: float = 3600.0,
    ppm: float = 50.0,
    jitter_s: float = 0.01,
    lost: float = 0.03,
    step_s: float = 0.0,
    period_s: float = 0.0,
) -> Pulses:
    """Return pulses about 1 s apart, random or periodic, with some lost and some added on both clocks."""
    g = np.random.default_rng(seed)
    n = int(seconds)
    true_s = np.cumsum(np.full(n, period_s) if period_s else 0.2 + g.exponential(0.8, n))
    other_s = (true_s - g.choice([-1, 1]) * 10 ** g.uniform(0, 6)) / (1 + ppm * 1e-6)
    other_s[n // 2 :] += step_s
    keep, keep_other = g.random((2, n)) >= lost
    added = [g.uniform(clock[0], clock[-1], n // 100) for clock in (true_s, other_s)]
    seen_s = (other_s + g.normal(0, jitter_s, n))[keep_other]
    if step_s >= 0:  # a clock set back is left in the order of writing
        seen_s = np.sort(np.append(seen_s, added[1]))
    return Pulses(np.sort(np.append(true_s[keep], added[0])), seen_s, true_s, other_s)


def test_an_hour_of_pulses_is_mapped_to_2_ms_as_stated() -> None:
    """With 50 ppm, 10 ms of jitter, lost and added pulses, errors are below 2 ms and within the stated
    ones.
    """
    errors, sds = zip(*(simulated(seed).errors_s() for seed in range(4)), strict=True)
    assert max(np.abs(error).max() for error in errors) < 0.002
    assert np.mean(np.abs(np.concatenate(errors)) < 1.96 * np.concatenate(sds)) > 0.9


@pytest.mark.parametrize(("seconds", "jitter_s"), [(20, 0.01), (600, 0.001), (600, 0.0)])
def test_the_stated_error_covers_shorter_recordings(seconds: float, jitter_s: float) -> None:
    """Drifts are unknown, up to 500 ppm. Without jitter the times are exact."""
    held, worst = [], 0.0
    for seed in range(12):
        ppm = float(np.random.default_rng(seed).uniform(-500, 500))
        error, sd_s = simulated(seed, seconds, ppm, jitter_s, lost=0.05).errors_s()
        held.append(np.mean(np.abs(error) < 1.96 * sd_s))
        worst = max(worst, float(np.abs(error).max()))
    assert np.mean(held) > 0.9 if jitter_s else worst < 1e-6, np.mean(held)


@pytest.mark.parametrize("step_s", [0.4, -35.0, 3600.0])
@pytest.mark.parametrize("seconds", [40, 1200])
def test_a_clock_that_was_set_is_refused(step_s: float, seconds: float) -> None:
    pulses = simulated(1, seconds, step_s=step_s)
    refusal = fit_clock(pulses.reference_s, pulses.seen_s)
    assert refusal == WAS_SET


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_periodic_pulses_are_weak_with_an_error_of_a_period(lost: float) -> None:
    for seed in range(3):
        fit = simulated(seed, 100, jitter_s=0.003, lost=lost, period_s=0.7).fit()
        assert "send pulses at irregular intervals" in fit.message
        assert fit.clock_sd_s > 0.69


def test_a_single_pulse_gives_only_the_offset() -> None:
    fit = fit_clock(np.array([12.5]), np.array([1002.0]))
    assert isinstance(fit, ClockFit)
    mapped_s, sd_s = fit.mapped(np.array([1002.0, 1062.0]))
    np.testing.assert_allclose(mapped_s, [12.5, 72.5])
    np.testing.assert_allclose(sd_s**2, [2e-4, 2e-4 + (60 * 250e-6) ** 2])
    assert "only 1 common pulse:" in fit.message
    assert "500 ppm, or 30 ms per minute" in fit.message


@pytest.mark.parametrize("n", [2, 5, 40, 200])
def test_unrelated_pulses_are_never_called_ok(n: int) -> None:
    for seed in range(8):
        reference_s, other_s = np.cumsum(0.2 + np.random.default_rng(seed).exponential(1, (2, n)), -1)
        fit = fit_clock(reference_s, other_s)
        assert isinstance(fit, str) or fit.message


@pytest.mark.parametrize(
    ("reference_s", "other_s", "message"),
    [
        ([], [1.0], "no pulse on the recording's clock"),
        ([1.0], [], "no pulse in the file"),
        ([1.0, 2.5], [7.0, 9.5], "the 2 pulses of the file match the 2 of the recording at no offset"),
    ],
)
def test_unmatched_pulses_are_refused(reference_s: list[float], other_s: list[float], message: str) -> None:
    refusal = fit_clock(np.array(reference_s), np.array(other_s))
    assert isinstance(refusal, str)
    assert message in refusal
