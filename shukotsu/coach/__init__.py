"""The coach: what a hand's calibration still lacks, asked for and shown while it is recorded."""
