"""Make pages of the guide: reference pages from the schemas, and hooks of the site."""
