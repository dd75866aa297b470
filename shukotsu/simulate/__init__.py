"""Simulator: a hand, its motion, and the recording that a tracker makes of it, with the exact truth."""
