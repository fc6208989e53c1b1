"""The two databases: their sessions, and what each does in its own way."""
