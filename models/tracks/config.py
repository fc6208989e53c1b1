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

# Shares of the image that were posted as pixels
SHARES_FEWEST = 1  # tracks: nobody walks within a pixel
SHARES_PX = (-1.25, 1.5)  # MOT text counts pixels from 1, and feet may lie below the image

# Another image size than the frame's (`image_size`): chosen on 17 recordings, scaled and cropped
USUAL_SIZES = (
    *((320, 180), (320, 240), (352, 240), (352, 288), (416, 234), (416, 416), (480, 270)),
    *((512, 288), (512, 512), (608, 608), (640, 360), (640, 480), (640, 640), (704, 480)),
    *((704, 576), (720, 480), (720, 576), (768, 432), (800, 450), (800, 600), (848, 480)),
    *((960, 540), (1024, 576), (1024, 768), (1280, 720), (1280, 960), (1600, 900)),
    *((1920, 1080), (2048, 1536), (2304, 1296), (2560, 1440), (2592, 1944), (2688, 1520)),
    *((3072, 1728), (3840, 2160)),
)  # streams of network cameras and inputs of detectors, in px
SIZE_PARTS = (4, 3, 2, 1 / 2)  # of the frame's own size, beside them: half of 2688 is in no list
SIZE_FEWEST, SIZE_FEWEST_SPEEDS = 30, 4  # tracks, and those that walk on the ground
SIZE_MARGIN, SIZE_WITHIN = 0.01, (0.995, 0.9)  # of an edge; the share of u and of v within it
SIZE_LOWEST = 1.5  # times the height: feet below the image, where boxes are completed
SIZE_REACH_QUANTILE = 0.99  # of u and v, which reach so far to the right and down:
SIZE_REACHED, SIZE_FILLED = 0.85, 0.4  # of the width or the height, and of the other
SIZE_CLOSENESS, SIZE_MOST_NAMED = 12.0, 4  # log odds by the log of that share; sizes of a reason
SIZE_SAME_SHAPE = 0.03  # relative difference of two aspect ratios
# Log odds: terms of one size, and what another one has to be better by
SIZE_STRIDE_S, SIZE_PAUSE = 1.4, 0.3  # of a speed; slower than that share of a track's own: paused
SIZE_SPEED_MPS, SIZE_SPEED_SD = 1.25, 0.25  # of a site's median; sd of its log
SIZE_SPEEDS_MPS = (0.6, 2.1)  # medians of recorded sites are 0.66 to 1.5
SIZE_STATURE_M, SIZE_STATURE_SD = 1.8, 0.1  # of boxes, which are a little loose
SIZE_MOST_LEVEL = 12.5  # five standard deviations: a wrong height is not worth more
SIZE_MOST_TRACKS = 60  # people of one hour are alike: more tracks say the same again
SIZE_PACE_WEIGHT, SIZE_SPREAD_WEIGHT, SIZE_STATURES = 1 / 6, 1 / 12, 5.0  # a track; all boxes
SIZE_UNKNOWN_PACE = 0.6  # spread of a log where too few walk on the ground
SIZE_OUTSIDE = 30.0  # if all feet are outside the frame or above the horizon
SIZE_OTHER_SHAPE = 7.0  # streams keep their shape more often than not
SIZE_MOST_STATURE = 4.0  # that boxes count against a size; for one never: hidden feet halve them
SIZE_LEAST_GAIN = 7.5  # people in a corner of a recording reach 7.2 at one camera, else 3.8
