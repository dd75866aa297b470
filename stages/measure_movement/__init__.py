"""What a recording shows of movement: ranges of motion, speeds, cycles, and the ways of the fingertips."""
