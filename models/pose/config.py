"""Numbers that a pose hangs on: unit, source, and how the result hangs on them.

Where no source is named, a number was tuned on the recorded scenes by `python -m studies protocol`.
"""

import math

import numpy as np

from models.monitoring.config import HABITS_OF_DAYS

# The search for modes.
HEADING_SD = math.radians(15.0)  # a pose offset's, before any track, around its peak
# Tried: a map's peaks are some 4 deg wide; the far ones where people fit none of the near.
HEADINGS = np.radians(range(-30, 31, 2)).tolist()
FAR_HEADINGS = np.radians([*range(-180, -30, 3), *range(33, 180, 3)]).tolist()
ON_MAP = 0.3  # of the walking groups must be on seen ground, for a pose to be held by the paths
ROUNDS = 2  # of fitting speeds with the heading by places: a third changes hundredths of a sd
WARM_ROUNDS = 1  # from a warm start, whose heading is known
UNLIKELY = 12.0  # of the log posterior, below the best: speeds are not fitted again there
FAR_LOG_HEIGHT = 0.7  # from the speeds': twice as high, everybody walks where nobody was seen
SHARED = 3  # parameters that speeds and places both determine, tilt, roll, height: Birge's freedom

# What a fused estimate needs, and says.
FEWEST_GROUPS = 5  # walking groups: of fewer, places have no part
BY_CHANCE = 0.01  # of still cameras seem turned in tilt or roll: else changed paths are a clock's
ALTERNATIVE = 0.05  # odds against the best from which another pose is named
NO_ALTERNATIVE = 1e-6  # odds below which another pose is not even begun at next time

# A change of the pose within a window.
FEWEST_BESIDE = 12  # tracks before and after: fewer do not make a pose of their own
CHANGE_BY_CHANCE = 1e-3  # of windows differ so much where they are cut; their cuts are dependent
CUT_ROUNDS = 2  # of fitting both sides and cutting anew
CLEARLY_BELOW = 0.8  # of the limit: a rough look is the same within a few hundredths
SUSPECTED = 1.0  # of the limit, by derivatives: it is twice that wherever a cut is confirmed
SUSPECT_RATE = 0.01  # of windows of a still camera that are looked at twice for their places
MOVED_BY_CHANCE = 1e-4  # of windows that are suspected already: Hotelling's T squared
MOVED_BY_HABIT = 1e-5  # of them, people's habits being normal: a chi square
GROUPS_OF_A_COVARIANCE = 7  # more than there are parameters, for it to be known at all
# Variances by the four parameters of what people of one hour do otherwise than those of another: a
# pace that is 3 % off is a height that is 3 % off.
HABITS = (
    np.append(
        HABITS_OF_DAYS[:2], [np.hypot(HABITS_OF_DAYS[2], HABITS_OF_DAYS[4]), HABITS_OF_DAYS[3]]
    )
    ** 2
)
# How much surer a part of a window may be of a parameter than as many people of the reference were:
# another view may be a better one.
BETTER_VIEW = 2.0

# When the camera moved.
MOVE_TIME_LEVEL = 0.9  # of the interval that is reported
# Of tracks may be of neither pose: bounds what one of them says of the time. With fewer, the
# interval is narrower and misses more.
ODD_TRACKS = 0.02

# When a warm start is enough: estimates from one are then within 0.05 sd of a full search.
WARM_TRACKS = 150  # at least: of fewer a full search is soon made, and each counts for much
NEW = 0.5  # of the window since the last full search; with a quarter, estimates are no nearer
FARTHEST = 1.0  # standard deviations that a few new tracks move a pose by
WIDER = 1.25  # times the standard deviation
WORSE = 10.0  # of the log likelihood: other modes are some 40 below, or known
SUSPICION, MORE_SUSPICION = 0.4, 1.25  # of the limit; times what it was where nothing was found

# Slow drift of an anchor in radians: a track turned by less is used unchanged.
NO_TURN_RAD = np.radians(0.02)

# What moved. Shares and sizes are guesses by what brackets do: a screw slips in tilt, a hand turns
# the pan, nearly nothing changes a pole's height. Chosen once on seven scenes by time.
MOVED_PRIOR = 0.2  # that a window is of a camera that has moved: lower, and small moves are missed
MOVES_IN = np.array([0.5, 0.4, 0.4, 0.5])  # of moves change tilt, roll, height, heading
ALL_SHARE = 0.3  # of moves change all four: a bracket that is hit, a camera that is hung anew
JOINT_SHARE = 0.1  # of moves are of one angle alone: one joint slips, each as often
TURNED_SHARE = 0.1  # of moves are a pan by hand, far, and nothing else
SCALE_SHARE = 0.1  # of changes are of the scale alone: a wrong clock looks like a height
MOVE_SD = np.array([math.radians(4.0), math.radians(4.0), 0.10, math.radians(6.0)])
# How far a camera that stands may be from its prior pose: brackets sway, and poses are rounded.
REST_SD = np.array([math.radians(0.1), math.radians(0.1), 0.003, math.radians(0.1)])
FAR_SHARE, FAR_MOVE = 0.15, 5.0  # of moves are so many times as far
# Degrees of freedom of Student's t: by few groups an estimate is farther off than its covariance.
LEAST_FREEDOM, FREEDOM_OF_A_GROUP = 4.0, 0.25
# Times chance, that people of other hours lose at the true pose in the log posterior: all alike,
# and more with each walking group. Of 149 still windows the mean is 1.4 and 0.02: with less, some
# of 300 groups are suspected; with twice as much, small moves are missed again.
OTHER_HOURS, OTHER_HOURS_OF_A_GROUP = 1.5, 0.03
# Other causes than a move, each as seldom as a move of the scale alone.
CAUSE_GAIN = 2.0  # of the log likelihood: with less, none is asked
CLOCK_SD = 0.15  # of the log of times, where a clock is wrong: 30 Hz taken for 25 are 0.18
LENS_SD = 0.25  # of the log of the focal length, where a lens was zoomed
CAUSE_MOVED = 0.1  # likely moved: of less, causes are asked with each full search alone
CAUSE_NAMED = 0.9  # of a change that is certain: else it has the name of a move
LENS_BY_SPEEDS = 0.8  # of what speeds gain by a clock they gain by a lens, where it is one
# An image beside the people.
# Degrees of freedom of its Student's t: likeliest are 5 in 30 comparisons across a real change of
# light with some 25 inliers (../shared/pictures), and 20 or more in 139 turns of photographs with
# 150 or more. With more degrees, a small turn needs fewer inliers; a wrong one counts for more.
LEAST_IMAGE_FREEDOM, INLIERS_OF_A_DEGREE = 4.0, 20.0
# The chance that a match is wrong. Of 1,060 pairs of two scenes, one matched, by the fewest inliers
# (`python -m studies pictures`); of 1,673 others, 483 had a consensus of 3, 61 of 4 and 1 of 5, so
# a tenth in each 4 inliers is cautious. What remains however many agree (a lorry, a banner) is the
# bound of 10,070 pairs of one pose without a false move, 3e-4 at 95 %, in its middle.
WRONG_OF_FEWEST, FEWEST_MATCHED, INLIERS_OF_A_TENTH = 1e-3, 8, 4.0
WRONG_OF_MANY = 1e-4
# What images have in common does not average out: a wrong reference makes all of them wrong, and
# the places of its features are in each comparison. That share of the variance is a sixth in 30
# turns by two references of one pose (../shared/pictures), more here; the chance is a guess, a
# tenth of that of one image.
WRONG_OF_ALL, COMMON_VARIANCE = 1e-5, 0.25
AGREE_BY_CHANCE = 1e-3  # of images that agree seem not to: a chi square of three angles
SITE_CHANGES, MOVED_SINCE = 0.02, 0.02  # of windows: people go elsewhere; it moved after them
PICTURED = 0.5  # likelier right than wrong
# How often paths are not found again: of cameras turned far, and of those that stand.
LEAVES_PATHS, PATHS_CHANGE = 0.5, 0.02
# A still camera is told to stand where a turn would have been noticed: at four sd, 12 deg would.
NOTICED_SD, NOTICED_RAD = math.radians(3.0), math.radians(5.0)
CHART_EVIDENCE = 0.1  # of a chart's log likelihood ratio beyond its level: days differ by the rest
LEAST_FALSE = 0.02  # at least, of a stationary camera's windows

# A pose by people alone: tilt, roll (radians), log height.
CALIBRATION_TILTS_RAD = np.radians(np.arange(0.0, 80.0, 4.0))
CALIBRATION_ROLLS_RAD = np.radians(np.arange(-6.0, 7.0, 3.0))
LEAST_TILT_RAD, MOST_TILT_RAD = math.radians(-15.0), math.radians(85.0)
CALIBRATION_STARTS, CALIBRATION_ROUNDS = 4, 4
CALIBRATED = 1e-3  # rad and log height of a round: less is the end
LEAST_ACROSS = 0.05  # of steps go across the others' way; of directions that are 13 deg apart
