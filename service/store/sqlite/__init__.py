"""The database as an SQLite file: its engine, its errors, whose turn it is, copies."""
