"""HTTP routes with their schemas above them: they translate, and call one use case each."""
