"""Benchmarks: cost and accuracy of the stages, each number beside a reference from the same run."""
