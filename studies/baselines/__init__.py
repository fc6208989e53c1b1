"""What others do, small and whole, to stand beside what is served. Nothing of it is served."""
