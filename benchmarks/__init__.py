"""Benchmarks: cost and accuracy of the stages, with references from the same run."""
