"""Read recordings of any format: a file becomes samples, which are checked and written as a poses table."""
