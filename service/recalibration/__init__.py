"""Use cases, one function for each verb; routes and jobs call these and nothing below them."""
