"""Section 5 of the paper, Eq. 8-11: the posture of the metacarpals, which carry no receiver."""
