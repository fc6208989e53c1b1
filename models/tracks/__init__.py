"""Who is behind the tracks: the pieces of one walk are put together."""
