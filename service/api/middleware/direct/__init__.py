"""Small requests answered directly: what each of them does not need is left out."""
