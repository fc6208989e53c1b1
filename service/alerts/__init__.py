"""Alerts: opened, silenced, grouped and ended; silence of cameras and of their estimates."""
