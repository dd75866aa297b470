"""What the report's tests share: a made-up study, and a reader of the page."""
