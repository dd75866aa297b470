"""Still pictures of the pages, written as SVG in one style and one palette."""
