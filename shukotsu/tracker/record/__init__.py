"""Recording a tracker: its port, its set-up before the first frame, the loop that keeps every byte."""
