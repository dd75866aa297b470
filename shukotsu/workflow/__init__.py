"""What only the Snakefile needs: files and digests of a study, its tables, progress, the warm process."""
