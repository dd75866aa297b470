"""A study's movement page: which joints moved, whether groups differ, how it repeats, and by which models."""
