"""The database itself: its engine and sessions, its file, its errors, whose turn it is."""
