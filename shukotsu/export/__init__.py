"""A person's skeleton and its motion as files that animation and biomechanics programs read."""
