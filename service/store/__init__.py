"""The SQLite store: tables, and every SQL statement."""
