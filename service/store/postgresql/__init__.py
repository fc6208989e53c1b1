"""The database on a PostgreSQL server: its engine and locks, its errors, its first schema."""
