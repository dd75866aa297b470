"""Not in the paper: what was declared about recordings, against what their poses say."""
