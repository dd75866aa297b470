"""From whatever a lab has to the poses table: the first stage.

A tracker: record (ports, handshakes, live view) -> archive (every byte) -> decode (records), with the help of
trackers (what each family sends); emulate is a tracker's end of the line. A file: formats. Either way samples
(what every reader gives) -> poses (checks, full grid).
"""
