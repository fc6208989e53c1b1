"""Ten thousand cameras on a PostgreSQL server, with estimates that cost nothing."""
