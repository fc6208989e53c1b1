"""Numbers that alarms and data gaps hang on: unit, source, and what hangs on each.

Where no source is named, a number is ours, chosen on recorded days or on simulated years.
"""

import math

import numpy as np

# Scores of walking groups
STEP_SHARES = (1.0, 0.35)  # of a map's reach: it is smoothed by a metre, and has finer lines
LARGEST_RESIDUAL = 0.5  # of a log: a pace that is further off says no more, people who stand do not
PACE_SD, STATURE_SD = 0.2, 0.06  # of logs, between people: by these boxes and paces are weighed
SCORE_BOUND = 5.0  # widths from the middle: one strange group makes no alarm

# Chart: a window-limited CUSUM (Page 1954, Lai 1995)
FEWEST_GROUPS = 16  # walking groups that a move is detected by: of fewer there is no result
LENGTHS = np.unique(np.round(np.geomspace(FEWEST_GROUPS, 400, 21)).astype(int))  # groups tested
RUN = 1000  # walking groups; levels are of so many in a row
_ANGLES = tuple(float(np.radians(angle)) for angle in (1.0, 2.5, 6.0))
# Of tilt, roll, log height, heading and log of times, the smallest first; smaller moves are found
# later. 0.18 is 30 frames a second taken for 25.
OFFSET_SIZES = (_ANGLES, _ANGLES, (0.05, 0.12, 0.3), _ANGLES, (0.08, 0.18))
STRONGEST = 2.0  # times an offset of the grid: it stands for moves of up to so many sizes
# What a site's people do of themselves for hours on end, as moves of the camera, and of its clock:
# about as those of recorded days did beyond chance (`python -m studies still-days`). Their pace
# differed by 5 %, but 30 frames a second taken for 25, which is 18 %, must remain an alarm.
HABITS = np.array([np.radians(0.1), np.radians(0.2), 0.01, np.radians(0.2), 0.03])
# For days and seasons, of which too few are recorded to say: in rain and in winter they may walk
# elsewhere, and faster.
HABITS_OF_DAYS = np.array([np.radians(0.2), np.radians(0.2), 0.01, np.radians(0.3), 0.03])
OTHER_PEOPLE = 1.5  # times the reference's noise: whoever walks by on other days is another sample
LEAST_LEVEL = 5.4  # of a run of endless normal walking groups that is wrong once in e runs
SUSPICION = 100.0  # times as many alarms: who would be one of so many gets a second look

# Chart, learned
RESPONSE_GROUPS = 400  # walking groups that the responses to offsets are learned of, to some 4 %
RIDGE = 0.05  # of each score's variance is its own, so that no direction is too good
LEAST_SHRINKAGE = 0.02  # of correlations (Schäfer and Strimmer 2005)
BOOTSTRAP_RUNS = 100  # of a still camera, that the level is learned of
# Walking groups after one another that the bootstrap keeps together: people share their quarter of
# an hour, and runs of 16 are held against an offset. Of fewer, recorded days alarm twice as often.
BLOCK = 24
LEAST_BLOCKS = 12  # of a reference: short ones have shorter blocks

BORNE_OUT = 0.9  # probability by the pose from which a chart's alarm counts

# A clock that is wrong: the scale of a pose has jumped, its angles have not
CLOCK_LEAST_LOG = math.log(1.08)  # that the height has changed by, at least
CLOCK_TURNED = 0.25  # at the most, how likely an angle changed, too
USUAL_RATE_HZ = 25.0  # frames, where nobody says: for the words alone
GROUPS_FOR_POSE = 24  # walking groups; after fewer, an alarm about a scale waits for the pose

# Slow drift
SLOW_DRIFT_SHARE = 0.1  # of a camera's allowed false alarms
SLOW_DRIFT_TESTS = (
    200.0  # independent ones a year that it is worth, by logs drawn with its own noise
)
BLOCK_DAYS, MOST_BLOCKS = 7, 104  # weekends walk otherwise; two years
FEWEST_LOGGED = 60  # walking groups; with fewer the test is not made
SEASON_DAYS = 60.0  # a seasonal habit lasts as long: slower turns are slow drift
FREE_RAD = np.radians(60.0)  # sd of a turn by one group, at the most: keeps all of it invertible
# Prior of the turn that growth takes out of tracks: how fast cameras drift, and how many do.
SLOW_DRIFT_RAD, SLOW_DRIFT_DAYS, SLOW_DRIFT_PRIOR = np.radians(0.5), 30.0, 0.1

# Arrivals: chosen on the simulated years of `studies.alarms.arrivals_study` (seed 7)
FEWEST_WEEKDAYS, FEWEST_WEEKEND_DAYS = 5, 4  # days of each, for the two to have their own rates
TAIL = (0.9, 0.99)  # quantiles of gaps that the burst is read at
FEWEST_GAPS, BURST_UNKNOWN = 10, 3.0  # beyond a quantile, to read it; with fewer, the burst
DAY_VARIANCE, DAY_WEIGHT = 0.1, 5.0  # of the day's level before many are seen, worth so many days
SHAPES = (1.0, 50.0)  # of the day's level, at least and at the most
QUIET_LEVEL, QUIET_SHAPE = 0.25, 20.0  # of the usual people, on a quiet day, give or take a fifth
QUIET_SHARE = 0.05  # of days
TURNS_QUIET = 0.1  # of changes of the level
CHANGES_PER_HOUR = 0.05  # of the level within a day: the more, the sooner a silence is usual
FEW_GROUPS = 3.0  # walking groups that may stay away any day
IMPLAUSIBLE = 1e-3  # chance below which people should have been seen: then the fixed limit counts
