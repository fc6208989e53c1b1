"""Glossary of the pages, for readers without statistics; the docs' glossary includes it.

Labels of states and actions come from where they are defined, so both are always the same.
"""

from service.enums import Action, AlertKind, Answer, PoseState
from service.wording.actions import ACTIONS
from service.wording.camera import STATES
from service.wording.language import N_

WORDS = {
    N_("States"): {
        STATES[PoseState.OK]: N_(
            "The newest tracks fit the camera's original position: it has not moved."
        ),
        STATES[PoseState.DRIFTING]: N_(
            "The camera was knocked, sagged or was turned. The alert stays open until an operator "
            "answers it or new tracks fit the original position again."
        ),
        STATES[PoseState.SUSPECTED]: N_(
            "A move is more likely than not, but too small or too uncertain for an alert. More "
            "tracks will decide."
        ),
        STATES[PoseState.UNSURE]: N_(
            "People no longer walk on the learned paths. Either the camera turned far, or people "
            "walk elsewhere. Check its image."
        ),
        STATES[AlertKind.CLOCK]: N_(
            "People appear too fast or too slow, as with a wrong clock or frame rate. The camera "
            "itself has probably not moved."
        ),
        STATES[AlertKind.LENS]: N_(
            "The angle of view changed: the lens was zoomed, or the image is cropped or scaled. "
            "The camera itself has not moved. Restore the lens or enter its new focal length."
        ),
        STATES[PoseState.NO_DATA]: N_(
            "No tracks for longer than usual at this hour. Camera, tracker or network may be "
            "down, or the place is closed."
        ),
        STATES[PoseState.LEARNING]: N_(
            "Too few tracks so far, to learn the reference or to know whether the camera moved."
        ),
        STATES[PoseState.UNCALIBRATED]: N_(
            "The camera's height and direction are unknown. Surefoot estimates them from the "
            "first tracks and asks you to confirm them."
        ),
        STATES[PoseState.UNCONNECTED]: N_("No track was posted and no image was compared yet."),
    },
    N_("Position"): {
        N_("Tilt"): N_("How far the camera looks down; 0° is the horizon."),
        N_("Roll"): N_("Rotation about the viewing direction; positive: its right side is lower."),
        N_("Pan, or heading"): N_("Viewing direction on the ground, clockwise, as on a compass."),
        N_("Height"): N_("From the ground that people walk on to the camera."),
        N_("Pose"): N_("Tilt, roll, pan and height, with the position on the ground."),
        N_("Prior pose"): N_(
            "The last trusted pose: entered at registration, confirmed, or accepted after a "
            "move. Moves are measured relative to it."
        ),
        N_("Drift"): N_(
            "Estimated pose minus prior pose, after subtracting the offset that the reference had."
        ),
        N_("Zone"): N_(
            "An area or line drawn in the image. After a move, it is redrawn where it belongs."
        ),
    },
    N_("Evidence"): {
        N_("Track"): N_("The path of one person through the image, from a tracker."),
        N_("Tracker"): N_(
            "The program that detects people in a camera's images and posts their tracks. If a "
            "camera has several, one is active."
        ),
        N_("Person"): N_("Counts once, even if the tracker splits a walk into several tracks."),
        N_("Reference"): N_(
            "Where people walk and how fast, learned from the first tracks (about 200) of a "
            "stationary camera. Moves are detected relative to it."
        ),
        N_("Image"): N_(
            "A snapshot that is compared with earlier ones, if enabled. It shows a turn even "
            "without people."
        ),
        N_("Sure to"): N_(
            "“Tilt 22.1°, 21.8° to 22.4°” means that the true value is between the two in nine of "
            "ten cases. A value that tracks do not determine is omitted."
        ),
        N_("False alarm"): N_(
            "An alert although the camera did not move. A setting limits their number per year."
        ),
    },
    N_("Actions"): {
        ACTIONS[Answer.PUT_BACK].one: ACTIONS[Answer.PUT_BACK].means,
        ACTIONS[Answer.ACCEPTED].one: ACTIONS[Answer.ACCEPTED].means,
        ACTIONS[Answer.FIXED].one: ACTIONS[Answer.FIXED].means,
        ACTIONS[Action.ACKNOWLEDGE].one: ACTIONS[Action.ACKNOWLEDGE].means,
        N_("Silence"): ACTIONS[Action.SILENCE].means,
        N_("Maintenance"): ACTIONS[Action.MAINTENANCE].means,
        ACTIONS[Action.RESET].one: ACTIONS[Action.RESET].means,
        N_("Site and tags"): ACTIONS[Action.TAG].means,
    },
}
