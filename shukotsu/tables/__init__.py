"""Tables and files: typed Parquet tables, poses in blocks, limits, text files, atomic writes."""
