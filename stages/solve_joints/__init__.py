"""Section 4 of the paper, Eq. 1-7: joint centres between two receivers."""
