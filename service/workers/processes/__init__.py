"""How our processes behave, start, live and end."""
