"""Learning a site's reference from its first tracks."""
