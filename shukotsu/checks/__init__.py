"""Compare what was declared about a recording with what its poses say; findings, each one sentence."""
