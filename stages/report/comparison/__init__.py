"""Say whether one skeleton model does better than another across the subjects of a study."""
