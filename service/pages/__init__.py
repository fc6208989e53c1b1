"""The operators' pages: routes with what they read, drawings, templates, static files."""
