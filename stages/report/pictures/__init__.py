"""Pictures of the pages and the print figures, all drawn with matplotlib in one style and one palette."""
