"""The paths of a site: a density of places and directions that registers a pose, in pan too."""
