"""Measure movement in a recording: ranges of motion, speeds, cycles, and the ways of the fingertips."""
