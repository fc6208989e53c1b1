"""How people walk at a site, learned from its first tracks."""
