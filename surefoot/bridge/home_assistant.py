"""What Home Assistant finds cameras by: a retained message for each, a device of two entities."""

import json

_STATES = ("ok", "unsure", "suspected", "drifting", "no_data", "learning")


def discovery_of(camera_id: str, name: str, topics: str, availability: str, version: str) -> str:
    """The payload of `<discovery prefix>/device/surefoot_<camera>/config`; needs 2024.11.

    `topics` is what those of the camera begin with.
    """
    key = f"surefoot_{camera_id}"
    document = {
        "dev": {"ids": [key], "name": name or camera_id, "mf": "surefoot"},
        "o": {"name": "surefoot", "sw": version},
        "avty_t": availability,
        "cmps": {
            "alert": {
                "p": "binary_sensor",
                "name": "Alert",
                "uniq_id": f"{key}_alert",
                "dev_cla": "problem",
                "stat_t": f"{topics}/alert",
                "val_tpl": "{{ 'ON' if value_json.firing else 'OFF' }}",
                "json_attr_t": f"{topics}/alert",
            },
            "state": {
                "p": "sensor",
                "name": "State",
                "uniq_id": f"{key}_state",
                "stat_t": f"{topics}/state",
                "val_tpl": "{{ value_json.state }}",
                "json_attr_t": f"{topics}/state",
            },
        },
    }
    return json.dumps(document)
