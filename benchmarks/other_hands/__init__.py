"""An independent simulator of hands, on which checks and solvers developed on the other are evaluated.

It is written from the published anatomy and the layouts' descriptions alone and shares only the format of
poses with the project's simulator.
"""

from benchmarks.other_hands.person import Person, draw_person
from benchmarks.other_hands.recording import DrawnRecording, Session, record, true_centres

__all__ = ["DrawnRecording", "Person", "Session", "draw_person", "record", "true_centres"]
