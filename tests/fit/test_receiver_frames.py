"""Which frames are fitted: those that together show the widest spread of postures."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shukotsu.fit.receiver_frames import spread_frames


@given(st.integers(0, 1000), st.integers(1, 300), st.integers(1, 60))
def test_frames_are_different_and_stand_for_all(seed: int, n_frames: int, wanted: int) -> None:
    postures = np.random.default_rng(seed).normal(size=(n_frames, 4))
    rows, share = spread_frames(postures, wanted)
    assert len(rows) == len(share) == min(n_frames, wanted)
    assert (np.diff(rows) > 0).all()
    assert share.sum() == np.float64(1.0) or abs(share.sum() - 1) < 1e-12
    assert (share > 0).all()


def test_dwelling_counts_once() -> None:
    """A posture that is held gets one frame and the share of the time that it was held."""
    postures = np.concatenate([np.zeros((900, 1)), np.linspace(0.1, 1, 100)[:, None]])
    rows, share = spread_frames(postures, 10)
    held = rows < 900
    assert held.sum() == 1
    assert share[held][0] > 0.89
