"""Numbers that a pose by walking hangs on: unit, source, and what hangs on each.

Where no source is named, a number is ours, chosen on the protocol's scenes or on simulated sites.
"""

import math

import numpy as np

# Evidence that is needed
FEWEST_WALKERS = 5  # tracks with a step; of fewer there is no estimate and no reference
FEWEST_GROUPS = 5  # walking groups; with fewer nothing is identifiable, and variances grow by 5 / n
FEWEST_BOXED = 8  # tracks with boxes; with fewer, statures are no channel
LEAST_STATURE_SD = 0.02  # of a log; boxes that differ by less are drawn, not measured: no channel
HEADS_OF_REFERENCE, HEADS_OF_WINDOW = 12, 5  # tracks with heads; with fewer, heads say nothing

# Mixed model
FREEDOM = 4.0  # degrees of freedom of both Student-t (Lange, Little and Taylor 1989)
OUTLIER_PRIOR_ROWS = 2.0  # rows that the site's share of outliers counts for in a track's own
OUTLIER_ROUNDS = 4  # of a track's own share: more move it by less than a hundredth
WEIGHT_ROUNDS = 3  # of re-weighting at given residuals
INDEPENDENT_ROWS = 4  # of a track, at most, where starts are compared: long ones are as short
ABOVE_HORIZON = -8.0  # log density of a row that is all but impossible, where starts are compared
# Bounds of EM, of logs (trends: in 10 s): few tracks make no site of equals or of strangers.
BETWEEN_SD, TREND_SD, WITHIN_SD = (0.02, 0.5), (0.005, 0.3), (0.01, 0.5)
MOST_CORRELATION = 0.8
OUTLIER_SHARE, OUTLIER_MEAN, OUTLIER_SD = (0.02, 0.8), (-3.0, 1.0), (0.3, 1.5)
EM_ROUNDS = 5  # of a reference

# Fields: logs of speeds and statures by place and direction; a prior's standard deviations
SPEED_LENGTH_M, SPEED_PLACE_SD, SPEED_DIRECTION_SD = 6.0, 0.10, 0.08  # freer: less sure poses
LEAST_SPEED_LEVEL_SD = 0.15  # sites' means are 1.05 to 1.43 m/s where 1.4 is usual
STATURE_M, STATURE_LEVEL_SD = 1.7, 0.06  # people, give or take 4 %; boxes are a little loose
STATURE_LENGTH_M, STATURE_PLACE_SD = 8.0, 0.03
MOST_BUMPS = 150  # of a field: wider sites have longer ones, and time grows with the square
PRIOR_SHARES = (0.03, 0.3, 1.0)  # of the speeds' standard deviations, tried by cross-validation
LEAST_GAIN = 1.0  # of the held-out log likelihood, for a larger share to be taken
HALVINGS = 2  # random ones that it is cross-validated by

# Search
STARTS = 2  # of the grid, beside the prior pose: more find no other mode on the scenes
START_TRACKS = 80  # that starts are compared and first fitted by
START_REACH_RAD, START_PLACES = math.radians(20), 11  # of tilt and roll, either way: 4 deg apart
START_DISTANCE_RAD = math.radians(5)  # between two starts, at least
START_VALID = 0.9  # of the rows are below the horizon there
START_QUANTILES = (0.4, 0.6, 0.75)  # of all speeds, standing people's too, to be the usual one
POSE_PRIOR_SD = np.array([math.radians(10), math.radians(10), 0.3])  # holds what tracks leave free
LONGEST_MOVE = np.array([0.06, 0.06, 0.25])  # of one round: tilt, roll, log height
MOST_ROUNDS = 40
CONVERGED = 0.001  # standard deviations, of one round; a short one may be far from the end
ROUGHLY = 0.1  # from a warm start: a round more moves it by some hundredths
SAME_MODE = np.array([math.radians(0.2), math.radians(0.2), 0.02])  # nearer are one mode
LEAST_LOG_ODDS = 12.0  # below the best mode, over the variance inflation: others are not named

# Covariance
MOST_NOISE = 0.95  # of the information along an axis that may be direction noise (Fuller 1987)
PLAUSIBLE_OFFSET = np.array([math.radians(1.0), math.radians(1.0), 0.1])  # ours on most sites
ASSUMED_INFLATION, HEADS_INFLATION = 3.0, 1.5  # squared errors over variances, before any are seen
ASSUMED_INFLATION_WEIGHT = 6.0  # held-out ratios that this counts for
LARGEST_RATIO = 9.0  # of one of them: one bad part does not decide
INFLATION_FOLDS = 4  # halves to sixteenths of the reference's times

# Walking groups: who counts as one draw of pace and pauses (time of a bin, distance, cosine, speed)
GROUP_BIN_S, GROUP_NEAR_M, GROUP_SAME_WAY, GROUP_STANDING_MPS = 3.0, 4.0, 0.8, 0.4
GROUP_SHARE = 0.6  # of the shorter walk, side by side

# What a reference may be: beyond it somebody has to look
USUAL_SPEEDS_MPS = (0.7, 2.0)  # medians of sites: 1.05 to 1.43 were seen
USUAL_STATURES_M = (1.4, 2.2)  # of boxes
DOUBTED_RAD, DOUBTED_SIGMAS = math.radians(4.0), 4.0  # of a free estimate from the prior pose

# Heads: radians
HEADS_PLAUSIBLE_OFFSET = np.radians([0.5, 0.5])
LEAN_BETWEEN_SD, LEAN_WITHIN_SD, LEAST_LEAN_SD = 0.03, 0.04, 1e-3  # at first; and never less
LEAN_EM_ROUNDS = 12
HABIT_SD = np.radians([4.0, 4.0])  # of a detector's bias, and of the lean of who walks to the right
COLUMN_SHARE_SD = 1.0  # before any head is seen
COLUMN_SHARE_OF_REFERENCE, COLUMN_SHARE_OF_WINDOW = 0.3, 0.5  # beyond two sd of it heads are unused
LEAST_HEAD_LOG_DENSITY = -12.0  # at a pose: heads alone call none impossible
HEAD_GRID_RAD = np.radians(np.arange(-24.0, 25.0, 8.0))  # of starts, around the prior pose
HEAD_START_TRACKS = 60
HEAD_CONVERGED, HEAD_LONGEST_MOVE = 1e-6, 0.06
HEAD_ANGLE_SD = 1.0  # of tilt and roll: what heads leave free is left free
