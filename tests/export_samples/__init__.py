"""What the tests of the exports share: hands with their tables, and readers of files that are not ours."""
