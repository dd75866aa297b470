"""What was declared about a recording against what its poses say; findings, each one sentence."""
