"""The average hand, once: estimators and simulator read it."""
