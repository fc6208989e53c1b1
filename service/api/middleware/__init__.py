"""What stands around the routes: connections, limits, access, errors, dependencies."""
