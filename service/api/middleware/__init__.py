"""Middleware around the routes: connections, limits, access, errors; their dependencies."""
