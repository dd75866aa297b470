"""Simulated hands against their truth: how far every estimator is off, and whether its sd says so."""

from __future__ import annotations

from benchmarks.accuracy.running import run

__all__ = ["run"]
