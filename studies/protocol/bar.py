"""The floor and the bar of the protocol: crude joint estimators, and what a served pose must reach.

Medians over 12 knocks of +-8 deg, angle and height.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """Of one scene, in words: two crude estimators' figures, and the bar.

    The first knows the site's speed, the second has its offset at the prior pose taken off.
    """

    site_speed: str
    offset: str
    bar: str


BARS = {
    "wildtrack-c1": Bar(site_speed="0.9 deg, 10 %", offset="0.7 deg, 9 %", bar="0.5 deg, 4 %"),
    "wildtrack-c3": Bar(site_speed="1.7 deg, 5 %", offset="1.8 deg, 3 %", bar="0.9 deg, 3 %"),
    "wildtrack-c6": Bar(site_speed="0.8 deg, 2 %", offset="0.8 deg, 4 %", bar="0.5 deg, 2 %"),
    "town-centre": Bar(site_speed="1.6 deg, 8 %", offset="2.3 deg, 9 %", bar="0.9 deg, 4 %"),
    "pets2009-s1l2-1-v001": Bar(
        site_speed="20 deg, 73 %", offset="4 deg, 12 %", bar="declared, covered"
    ),
    "pets2009-s2l1-v001-sort": Bar(
        site_speed="4.3 deg, 26 %", offset="6.5 deg, 11 %", bar="2 deg, 8 %, or declared"
    ),
    "meva-g336-school": Bar(site_speed="2.9 deg, 26 %", offset="1.6 deg, 10 %", bar="1.5 deg, 7 %"),
}
