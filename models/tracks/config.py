"""Numbers that what is read of tracks hangs on: unit, source, and what hangs on each.

Where no source is named, a number is ours, chosen on the recorded scenes.
"""

# Steps of walkers
STEP_S = 1.5  # from node to node: longer than a stride, shorter than a change of mind
KERNEL_S = 0.7  # half the width of the smoothing around a node (Cleveland 1979), at least
LONGEST_GAP_S, USUAL_GAPS = 1.1, 2.5  # seconds, and usual intervals: what is longer ends a run
SPARSEST_GAP_S = 10.0  # however far apart points usually are: a minute's straight line is no walk
MOST_NODES = 2_400  # of a track, an hour: what is longer is of a wrong clock; recorded are 1,849
RUN_POINTS = 3  # of a run, at least
LINE_POINTS = 2  # that make a line
DIRECTION_NODES = 2  # on both sides of a step that its direction is of: 4.5 s
MOST_DIRECTION_NOISE = 0.5  # radians

# Heads
SHORTEST_HEAD_PX = 8.0  # from foot to head: of less, half a pixel is more than people lean
HEAD_POINTS = 2  # of a step, at least

# Boxes that are too short for where their upper edges are: their feet are hidden
HIDDEN_FEWEST, HIDDEN_MOST = 8, 60  # boxes of a track, and of them a line is laid through
HIDDEN_QUANTILE = 0.7  # of a track's boxes so many may be hidden (Koenker and Bassett 1978)
HIDDEN_ROUNDS, HIDDEN_NEAREST = 12, 0.01  # of the line; what is nearer weighs no more (of a height)
HIDDEN_LEAST_LINE = 0.05  # of the middle height: no line is below it
HIDDEN_HOLD = 1e-4  # of all weights: holds the slopes of who keeps within a hundredth of a height
HIDDEN_LOG, HIDDEN_SDS = 0.12, 5.0  # shorter by both is hidden: 0.2 m, and a track's own noise

# Feet that jump up the picture and back
JUMP_FEWEST = 10  # points of a track: two jumps are less than a quarter of its changes
JUMP_AROUND = 2  # changes on either side of one that say what is usual there
JUMP_SHARE, JUMP_BEYOND = 0.25, 5.0  # times what that share of changes exceeds: 5.8 Gaussian sd
JUMP_LEAST = 0.01  # of the picture: 0.3 m of a person who takes 6 % of it
JUMP_LONGEST_S = 6.0  # in the air
JUMP_ALIKE = 2.0  # times as far down as up, or up as down

# Ends of tracks
END_SPAN_S, END_USUAL_GAPS = 1.5, 2.2  # of an end: longer than a stride, and two usual intervals
END_POINTS = 8  # of an end, at most: more of them say the same again
FOOT_NOISE_PX, FOOT_NOISE_M = 1.0, 0.035  # sd, the latter across the line of sight: of a stride

# Pieces of one walk (after Huang, Wu and Nevatia 2008)
PIECE_GAP_S = 3.5  # between two, at most: walkers of other recordings come back later as others
MOST_FOLLOWERS = 64  # of a piece that are looked at, the first to come: recorded are 13 at most
WANDER = 0.18  # of the pace: how much of it is not predicted, along and aside
SLOWEST_MPS, LEAST_PACE = 0.3, 0.3  # a usual pace where most stand; of it: who stands shifts, too
PACE_SD, TALL_SD = 0.3, 0.08  # of logs, between two looks at one walk
LINK_FREEDOM = 4.0  # of a Student-t: some stop, turn or are seen badly
FARTHEST = 30.0  # of a chi square of 5 or 6, with tails like these
CLEAR = 4.0  # twice the log odds against the next best of either piece, for a link
STRANGERS = 10.0  # odds against any two that happen to follow: doors bring people together
STRANGERS_S = 5.0  # at the usual pace: two are at least as far apart by chance
MANY_PIECES = 0.1  # of the tracks: so many are worth a word
