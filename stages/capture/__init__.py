"""From whatever a lab has to the poses table: the first stage, one module a step.

readers (which format is read by what) -> samples (what every reader gives) -> poses (checks, full grid).
"""
