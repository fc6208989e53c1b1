"""Names of cameras in other systems."""

from collections.abc import Mapping


def camera_id_of(name: str, cameras: Mapping[str, str]) -> str:
    """Return the camera id for a name in another system, such as Frigate's `front_door`.

    `cameras` (`MQTT_CAMERAS`) maps names to ids. Any other name becomes lower case with hyphens.
    The result is not checked: a name may contain characters that no id has.
    """
    return cameras.get(name, name.lower().replace("_", "-"))
