"""Movement of the subjects: ranges, speeds, cycles, events and strokes; differences and repeatability."""
