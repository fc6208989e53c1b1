"""The surefoot service: HTTP, store, background jobs. Knows `models/`, never the other way."""
