"""The moving hand: one recording's motion packed into a page that plays it, without any other program."""
