"""Where people walk at a site, and which way: a map that tells where a camera looks, in pan too."""
