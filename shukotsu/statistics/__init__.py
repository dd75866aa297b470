"""Statistics with the subject as the unit: tests, intervals, effect sizes, curves, repeatability. Arrays
only.
"""
