"""The coach: while a calibration is recorded, it requests the movements still needed and shows results."""
