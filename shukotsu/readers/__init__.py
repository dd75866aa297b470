"""From whatever a lab has to the poses table: a file, in any format, becomes samples, and these the table."""
