"""Columns of a table of tracks, and the names that files use for them."""

import re
from collections.abc import Iterable

UNUSED = "-"
# What each column means. A name that is not listed is not used.
_SYNONYMS = {
    "frame": "frame frame_id frame_no frame_nr frame_num frame_number frame_index frame_idx "
    "frameid framenumber frameindex image_id fn",
    "time_s": "time_s time timestamp timestamp_s time_sec seconds t ts unix_time epoch epoch_s",
    "time_ms": "time_ms timestamp_ms epoch_ms milliseconds",
    "id": "id track_id trackid track tracker_id trackerid object_id objectid obj_id target_id "
    "targetid person_id ped_id pedestrian_id identity instance_id",
    "left": "left l xmin x_min x1 xtl x_left x_tl x0",
    "top": "top ymin y_min y1 ytl y_top y_tl y0",
    "right": "right r xmax x_max x2 xbr x_right x_br",
    "bottom": "bottom ymax y_max y2 ybr y_bottom y_br",
    "width": "width w",
    "height": "height h",
    "centre_u": "centre_u xc cx x_c x_center x_centre center_x centre_x xcenter xcentre",
    "centre_v": "centre_v yc cy y_c y_center y_centre center_y centre_y ycenter ycentre",
    "u_px": "u_px foot_u u foot_x x_foot",
    "v_px": "v_px foot_v v foot_y y_foot",
    "x": "x",
    "y": "y",
    "conf": "conf confidence score det_conf detection_score probability prob not_ignored",
    "class": "class cls class_id classid cls_id category category_id object_category label "
    "label_id object_class obj_class",
    "class_name": "class_name classname category_name label_name type object_type name",
    "lost": "lost",
    "visibility": "visibility visible_ratio vis",
}
_ROLES = {name: role for role, names in _SYNONYMS.items() for name in names.split()}
_PREFIX = re.compile(r"^(bounding_box|bbox|box|bb|b|rect)_?(?=[a-z])")

# The forms of a place in the image, by the columns that they need. The first that fits is used.
CORNERS = ("left", "top", "right", "bottom")
SIZE = ("left", "top", "width", "height")
CENTRE = ("centre_u", "centre_v", "width", "height")
FOOT = ("u_px", "v_px")
FORMS = (CORNERS, SIZE, CENTRE, FOOT)
NEITHER_CORNER_NOR_CENTRE = ("x", "y", "width", "height")


def role_of(name: str) -> str | None:
    """Return the meaning of a column by its name in a header, None for an unknown name."""
    plain = re.sub(r"[^a-z0-9]+", "_", re.sub(r"\(.*\)|\[.*\]", "", name.lower())).strip("_")
    for known in (plain, plain.removesuffix("_px"), _PREFIX.sub("", plain)):
        if known in _ROLES:
            return _ROLES[known]
    return None


def roles_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return the meaning of each column of a header, `UNUSED` for an unknown name."""
    lowered = [name.strip().lower() for name in names]
    roles = [role_of(name) or UNUSED for name in lowered]
    if "l" in lowered:  # beside it, t is the top, not the time
        roles = ["top" if name == "t" else role for name, role in zip(lowered, roles, strict=True)]
    # Names that count from 0: x1, y1 is then the lower right corner.
    if {"x0", "y0", "x1", "y1"} <= {_PREFIX.sub("", name) for name in lowered}:
        later = {"x1": "right", "y1": "bottom"}
        roles = [
            later.get(_PREFIX.sub("", name), role)
            for name, role in zip(lowered, roles, strict=True)
        ]
    if "class_name" in roles:  # a name decides, if there is a number, too
        roles = [UNUSED if role == "class" else role for role in roles]
    return tuple("class" if role == "class_name" else role for role in roles)


def form_of(roles: Iterable[str]) -> tuple[str, ...] | None:
    """Return the first form of a place that the columns have, None if they have none."""
    given = set(roles)
    return next((form for form in FORMS if given.issuperset(form)), None)
