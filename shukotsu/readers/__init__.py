"""From whatever a lab has to the poses table: the first stage.

A recording's file, whatever its format, becomes samples (formats), and these, checked and put onto a full
grid, the poses table. inspection says what is in a file and drafts the mapping that it needs. Trackers are a
room of their own: the commands that record and emulate are here.
"""
