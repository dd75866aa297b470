"""Scores of skeletons on recordings and against the truth, and statistics over subjects."""
