"""Which of a camera's tracks are looked at: references, windows, and requests for an estimate."""
