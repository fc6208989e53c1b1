"""The numbers of a pose as fields of JSON."""

# The parameters of a pose as fields of JSON.
FIELDS = {"height": "height_m", "tilt": "tilt_deg", "roll": "roll_deg", "heading": "heading_deg"}
