"""`surefoot protocol`: what is served, on recordings in the order of time."""
