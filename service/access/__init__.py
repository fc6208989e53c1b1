"""Who may do what: tokens, sessions of pages, and what each scope holds."""
