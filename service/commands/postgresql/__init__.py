"""Commands on a PostgreSQL database."""
