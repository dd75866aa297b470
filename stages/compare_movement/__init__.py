"""What a study says of its subjects' movement: differences, curves, repeatability, and under which models."""
