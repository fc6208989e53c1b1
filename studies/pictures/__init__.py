"""What two pictures of a camera tell of its turn, measured on real ones and on photographs."""
