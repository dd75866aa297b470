"""Measure what the stages cost and how well they do, each number beside another from the same run."""
