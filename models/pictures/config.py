"""Numbers that what is read of pictures hangs on: unit, source, and what hangs on each.

Where no source is named, a number is ours, chosen by `python -m studies pictures`.
"""

import math

# Features
ANALYSED_PX = 960  # longest side that is looked at: features are as many at 1280, at twice the time
MOST_PIXELS = 64 * 2**20  # of a picture
LEAST_SIDE_PX, MOST_SIDE_PX = 64, 2**14
MAX_FEATURES = 2000
CONTRAST = 0.02  # least contrast of a feature (Lowe 2004: 0.03; here walls and nights count, too)
MOST_STORED_BYTES = 16 * 2**20  # of features, unpacked

# Matches
RATIO = 0.8  # of the two nearest descriptors' distances (Lowe 2004, section 7.1)
CELLS = (12, 8)  # of the picture, across and down
OF_A_CELL = 3.0  # matches that count in a cell: a lorry or a text with hundreds is one thing
STILL_PX = 1.0  # of the analysed picture: what moves by less stands still on the screen
OVERLAY_BAND = 0.16  # of the height, above and below: where clocks and names are written

# Consensus
SAMPLES = 2000  # pairs of matches: with 5 % right ones, 5 pairs are
TOLERANCE = 0.004  # of the longest side: lenses are known to some pixels at their edges
LOG_ZOOM_SD, MOST_LOG_ZOOM = 0.3, math.log(4.0)
FEWEST_INLIERS, FEWEST_CELLS = 8, 5
LOG10_FALSE = -6.0  # of the number of false alarms (Moisan and Stival 2004)
RIVAL = 0.6  # of the best consensus' score: a second one as large makes both no evidence
# The rival may have more where what stands fills 28 of 96 cells: a lorry drives, walls do not
RIVAL_OF_WIDE, WIDE_CELLS = 0.9, 28
# Of the view still in sight: a car in other light may be all that matches, and has moved.
LEAST_SPREAD = 0.15
STANDING_CELLS = 0.2  # of a turn's cells that stand on the screen: masks and dirt fill fewer

# Covariance
LEAST_SIGMA_PX = 0.3  # of the analysed picture: of a feature's place, at least
FEW_INLIERS = (
    75.0  # at which variances double: few match in other light, and err more than they say
)
FLOOR_RAD = math.radians(0.02)  # sd of each angle, of pictures of one pose at other hours
FLOOR_LOG_ZOOM = 0.001
LENS_SHARE = 0.01  # of the turn: by how much the focal length and the distortion may be wrong
LENS_ACROSS = 0.05  # of that in the other directions
SHIFTED_MORE = 0.2  # of the inliers more by a shifted camera than by a turned one
SHIFTED_LEAST = 12  # more, at least: of a few, lines explain some by chance
MOST_DISPARITY_RAD = math.radians(10.0)  # between near and far things
SHIFTED_WIDER = 3.0  # times the standard deviations

# Gallery
MOST_REFERENCES = 8
FIRST_FEATURES, FIRST_CELLS = 100, 24  # of 96 cells: fog and night have fewer, an empty wall too
# Chosen by light: a reference of another light seldom matches
STRONG_INLIERS = 150  # a match that needs no second opinion, and a reference that needs no renewal
MOST_TRIED = 3  # references, of each picture: the likest in light first
LIKE_LIGHT = 1.0  # of `light_apart`: the same hour and weather
RENEWING_SD_RAD = math.radians(0.1)  # of a picture that becomes a reference, at most
BRIDGED_SD_RAD = math.radians(0.1)  # between two pictures that matched, it may have swayed
RENEWING_SHARED = 0.9  # of the old view in sight, at least
RENEWING_INLIERS = 20

# Health: beside these, thresholds are the gallery's own
FROZEN_S = 2 * 3600.0  # of equal pixels: of a camera that works, noise changes some in each picture
BLACK_MEAN, BLACK_SPREAD = 12.0, 6.0  # of 255
BLINDED_SHARE = 0.4  # of bright pixels more than the brightest of the gallery has
FEW_EDGES = 0.25  # of the gallery's fewest
BLURRED = 0.25  # of the gallery's least sharpness
ALIKE = 0.35  # correlation of edges: pictures of one pose in other light have more
SAME_FORM_BITS = 20  # of 64 that differ, at most: Zauner 2010 takes 32 for unrelated
