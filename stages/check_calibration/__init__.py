"""Before the study: which joints the calibration recordings move too little, and what to do about it."""
