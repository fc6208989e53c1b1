"""What the operators' pages are made of: drawings and words as pure functions, templates, static.

Templates and static files are package data. Nothing here knows HTTP or SQL.
"""
