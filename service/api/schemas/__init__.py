"""Request and response bodies, and their translation to and from values."""
