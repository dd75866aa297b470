"""Recording a tracker: its port, the talk with it before the first frame, the loop that keeps every byte.

port (bytes in and out) -> reader (a thread that stamps what comes) -> conversation (what is sent and
answered, all of it kept) -> a driver of each family (set up, start, stop) -> session (the loop)
-> statistics and live_view.
"""
