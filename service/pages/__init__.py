"""The operators' pages: what they read, drawings, routes, templates, static files."""
