"""A second drawing of hands, by which checks and solvers are judged that were made on the first.

Written from the published anatomy and the layouts' words alone; it shares nothing with the project's own
simulator but the table of poses it ends in.
"""

from benchmarks.other_hands.person import Person, draw_person
from benchmarks.other_hands.recording import DrawnRecording, record, true_centres

__all__ = ["DrawnRecording", "Person", "draw_person", "record", "true_centres"]
