"""Access: tokens, sessions of pages, and what each scope holds."""
