"""The words of pages for people who know no statistics; the docs' glossary has them from here."""

from service.enums import Action, Answer
from service.wording.actions import ACTIONS
from service.wording.language import N_

WORDS = {
    N_("What cameras do"): {
        N_("Steady"): N_("It stands where it should, as the newest people before it show."),
        N_("Moved"): N_(
            "It looks elsewhere than it did: it was knocked, sagged or was turned. An alert "
            "fires until somebody answers it or people show otherwise."
        ),
        N_("Maybe moved"): N_(
            "Likelier moved than not, but by too little, or shown by too few people, for an "
            "alert. The next people tell."
        ),
        N_("Unsure"): N_(
            "Something changed and nobody can say what: people walk on none of the paths that"
            " were learned. It was turned far, or they walk elsewhere. Look at its picture."
        ),
        N_("Clock"): N_(
            "People seem to walk too fast or too slowly. A wrong clock or frame rate looks "
            "like that; the camera itself may well stand."
        ),
        N_("Lens"): N_(
            "It shows another angle of view: somebody zoomed, or its picture is cut or scaled "
            "otherwise. The camera itself stands. Set it back, or say its new focal length."
        ),
        N_("No people"): N_(
            "Nobody has come for longer than is usual there at such an hour. Camera, tracker "
            "or network may be down; or the place is closed."
        ),
        N_("Learning"): N_(
            "People are still being counted to learn what is usual there. Nothing is judged yet."
        ),
        N_("Uncalibrated"): N_(
            "The camera has no prior pose. Its pose is estimated from the first tracks, and an"
            " operator has to confirm it."
        ),
        N_("Unconnected"): N_("No track was ever posted for it, and no image was compared."),
    },
    N_("How a camera stands"): {
        N_("Tilt"): N_("How far it looks down; 0° looks at the horizon."),
        N_("Roll"): N_("How far it hangs crooked; positive: its right side is lower."),
        N_("Pan, or heading"): N_("The way it looks on the ground, clockwise, as on a compass."),
        N_("Height"): N_("From the ground that people walk on to the camera."),
        N_("Pose"): N_("These four together, and where on the ground it stands."),
        N_("Prior pose"): N_(
            "The pose that moves are measured against: given at registration, confirmed, or "
            "accepted after a move."
        ),
        N_("Drift"): N_(
            "How far it stands off its prior pose, after what is usual there was taken off."
        ),
        N_("Zone"): N_(
            "An area or a line drawn in the picture. When the camera moves, it is drawn where"
            " it belongs now."
        ),
    },
    N_("What it is told by"): {
        N_("Track"): N_("The way of one person through the picture, as a tracker draws it."),
        N_("Tracker"): N_(
            "The program that finds people in a camera's pictures and sends their tracks. Of "
            "several for one camera, one counts."
        ),
        N_("Person"): N_("Counted once, though a tracker may draw one walk in pieces."),
        N_("Reference"): N_(
            "What is usual before a camera that stands: where people walk, and how fast. It "
            "is learned of the first people, some 200, and a move is told by it."
        ),
        N_("Picture"): N_(
            "A still image beside the people, where that is switched on: a second witness."
        ),
        N_("Sure to"): N_(
            "“Tilt 22.1°, 21.8° to 22.4°” means: nine times of ten the true number lies "
            "between the two. Where people cannot tell a number, none is shown."
        ),
        N_("False alarm"): N_(
            "An alert of a camera that never moved. How many there may be in a year is a setting."
        ),
    },
    N_("What is done"): {
        N_("It was put back"): ACTIONS[Answer.PUT_BACK].means,
        N_("Keep the new aim"): ACTIONS[Answer.ACCEPTED].means,
        N_("Fixed"): ACTIONS[Answer.FIXED].means,
        N_("Acknowledge"): ACTIONS[Action.ACKNOWLEDGE].means,
        N_("Silence"): ACTIONS[Action.SILENCE].means,
        N_("Maintenance"): ACTIONS[Action.MAINTENANCE].means,
        N_("Learn anew at the old aim"): ACTIONS[Action.RESET].means,
        N_("Site and tags"): ACTIONS[Action.TAG].means,
    },
}
