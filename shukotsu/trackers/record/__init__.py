"""Recording a tracker: its port, its set-up before the first frame, the loop that keeps every byte.

port (bytes in and out) -> conversation (a thread that stamps what comes; what is sent and answered, all of it
kept) -> the driver of a family (set up, start, stop) -> session (the loop) -> statistics and display.
"""
