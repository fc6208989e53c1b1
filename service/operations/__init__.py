"""Backup, restore and check of a data directory; health and metrics of the service."""
