"""The study's question: whether one skeleton model does better than another, over all subjects."""
