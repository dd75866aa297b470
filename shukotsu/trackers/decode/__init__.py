"""From the raw archive to records, in two passes over the file, so that memory does not grow with it.

stream (archive -> numbered records, block by block) -> survey (first pass: the clock, what is lost) ->
records_table (second pass: the table). All that a record is flagged with comes from the survey, so that it
does not matter where blocks end.
"""
