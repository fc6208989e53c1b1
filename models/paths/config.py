"""Numbers that a path density, its likelihood and its tests hang on: unit, source, and how.

Where no source is named, a number was tuned on the recorded scenes by `python -m studies protocol`.
"""

import math

import numpy as np

from models.durations import HOUR_S

# The map.
DIRECTIONS = 16  # nodes of a turn: between them cubic, so that no path's direction is a node's
CELL_M = 0.5  # between nodes: half of the finest bandwidth
MOST_CELLS = 160  # along one side of the grid; a wider site has larger cells
MARGIN_M = 12.0  # around where people were seen: where a pose offset may put them
QUANTILE = 0.002  # of the places at each side that are left out of the grid
ANYWHERE = 0.1  # of all people walk anywhere in the grid, any way: without, strangers decide
ANY_WAY = 0.15  # of those at a place walk any way
UNSEEN_COST = 0.5  # of the log density of a person on unseen ground, below that on seen ground
SLOT_PEOPLE = 100.0  # people of the whole day that a part of the day begins with
LEVELS = 64  # of one unit of a log density: rounding changes it by less than 0.008
SHADE_M = 2.0  # over which the edge of what the reference saw is blurred, as the map is
# Tried, of places (m) and directions (von Mises' kappa; 6 is 24 deg): more people bear finer ones.
BANDWIDTHS = ((1.0, 6.0), (0.7, 10.0), (0.5, 16.0))
SLOTS = 4  # parts of a day: night, morning, afternoon, evening, wherever midnight UTC falls
PEOPLE_OF_A_SLOT = 80  # at least, in two of them, for parts of the day to be tried
CLEARLY = 3.0  # standard errors by which parts of the day must predict better
BLOCK_NODES = 3  # along a side of a block of ground that is in view or not: coarser by 1 %, faster

# The likelihood.
STANDING_MPS = 0.35  # slower steps are nobody's who walks
TRACK_STEPS = 2.0  # a track tells as much as two independent steps at the most
NO_GROUND = -30.0  # log likelihood of a step above the horizon
# Of all people, whom a camera sees, at least: else views of empty ground explain whoever comes.
LEAST_SEEN = 0.1
VIEW_STEP = 0.01  # radians, and log height: of differences of what is seen
# How busy unseen ground is against the seen: tried, and a log-normal prior. Wider, far poses win.
BUSY_LOG = np.linspace(math.log(0.02), math.log(4.0), 9)
BUSY_MEAN, BUSY_SD = math.log(0.5), 1.0

# Registration.
STARTS = 3  # headings that are climbed from
STARTS_APART_RAD = np.radians(5)
HOPELESS = 40.0  # of the log posterior: a start so far below another ends below it, too
LONGEST_MOVE = 0.05  # of a round, radians and log height: the map's smoothing at 20 m
MOST_ROUNDS = 25
CONVERGED = 1e-3  # of the log posterior: 0.05 sd
REFINING_ROUNDS = 4
ROUGHLY = 0.03  # standard deviations, from a warm start
SAME_PEAK_RAD = np.radians(0.3)
CURVATURE_STEP_RAD = np.radians(0.6)  # of its differences; shorter, they are the map's roughness
LEAST_CURVATURE = 0.02  # of what the scores' scatter says: a flat map is no map
EVEN = 0.5  # of the way to the mean curvature, where it bends less than the scores scatter

# Learning how registration errs.
FEWEST_GROUPS = 12  # walking groups: of fewer there is no map
FOLDS = 4
# Bandwidths are chosen anew of twice as many tracks, which bear finer ones, and in the next part of
# a day, in which people may walk elsewhere: to choose takes a sixth of the time of learning a map.
MORE_TRACKS, HOLD_S = 2, 6 * HOUR_S
RUN = 6  # walking groups after one another that may be alike
# The inflation before any is seen, and how many runs that guess is worth.
ASSUMED_INFLATION, ASSUMED_INFLATION_WEIGHT = 1.3, 5.0
BIAS_NOISE = 0.5  # of the bias's, after what cancels between folds
BIAS_ELSEWHERE = np.array([0.05, 0.05, 0.05, 0.15])  # of a person's scatter: at a pose far away
FAR = np.array([np.radians(8), np.radians(8), 0.15, np.radians(8)])  # how far that pose is

# The test of changed paths.
CHANGED_RATE = 1e-4  # of windows with unchanged paths that are called changed
# Of the mean log density. By the first an hour differs from another; paths that half of the people
# leave for new ones cost 1.5 and more, and the same paths, other hours, with a map of 1,000 people
# 0.5 at the most (20 simulated sites, 6 cameras of recordings of days).
TIDE, NEW_PATHS = 0.35, 1.0
FEWEST_FITS = 5  # walking groups on seen ground by which two poses are told apart
MOSTLY_SEEN = 0.5  # of a place's ground must have been seen

# The test of a move within a window.
# How far both ways a score looks: radians, log height. The map is smoothed by about as much.
REACH = np.array([np.radians(3), np.radians(3), 0.08, np.radians(4)])
NEWEST_GROUPS = 8  # walking groups that a move is detected by, at least
MOST_GROUPS = 300  # of a window that is drawn
BLOCK_GROUPS = 3  # walking groups after one another that the bootstrap keeps together
DRAWS, PARTS = 1500, 30  # of the bootstrap; parts small enough to stay near the processor
RIDGE = 0.02  # of each score's variance is its own, so that no direction is too good
BODY = 0.05  # the share of draws at which looks are counted; beyond, Student's tail is theirs
