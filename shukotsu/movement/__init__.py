"""Compare the movement of a study's subjects: differences, curves, repeatability, and under which
models.
"""
