"""A whole hand fitted at once: every joint, every receiver's place and its skin, weighed against anatomy."""

NO_CALIBRATION = "no calibration recording"
"""How the reason begins why a hand was not fitted that nothing calibrates."""
