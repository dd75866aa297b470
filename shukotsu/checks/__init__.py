"""Test what was declared about a recording against its poses; the results are findings, one sentence each."""
