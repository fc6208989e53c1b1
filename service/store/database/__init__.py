"""The database, whichever it is: sessions, errors, revisions, and where its SQL differs."""
