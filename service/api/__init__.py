"""HTTP routes: they translate, and call one use case each."""
