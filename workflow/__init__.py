"""What only the Snakefile needs: a study's plans, the digest of a stage's code, the warm process."""
