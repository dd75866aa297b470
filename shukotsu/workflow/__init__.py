"""Only the Snakefile needs this: a subject's plan, the digest of a command's code, the warm process."""
