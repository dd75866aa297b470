"""Code that only the Snakefile uses: a study's files, digests and tables, progress, and the warm process."""
