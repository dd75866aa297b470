"""Statistics with the subject as the unit: tests, intervals, effect sizes, repeatability. Arrays only."""
