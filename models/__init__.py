"""Cameras, people and statistics: knows nothing of HTTP, SQL or the files of the service."""
