"""Export of a person's skeleton and its motion to files of animation and biomechanics programs."""
