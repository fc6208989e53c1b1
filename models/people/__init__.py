"""Who is behind the tracks: pieces of one walk put together, and which of them are walkers."""
