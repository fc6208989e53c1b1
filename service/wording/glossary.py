"""The words of pages for people who know no statistics; the docs' glossary has them from here."""

WORDS = {
    "What cameras do": {
        "Steady": "It stands where it should, as the newest people before it show.",
        "Moved": "It looks elsewhere than it did: it was knocked, sagged or was turned. An alert "
        "fires until somebody answers it or people show otherwise.",
        "Maybe moved": "Likelier moved than not, but by too little, or shown by too few people, "
        "for an alert. The next people tell.",
        "Unsure": "Something changed and nobody can say what: people walk on none of the paths "
        "that were learned. It was turned far, or they walk elsewhere. Look at its picture.",
        "Clock": "People seem to walk too fast or too slowly. A wrong clock or frame rate looks "
        "like that; the camera itself may well stand.",
        "No people": "Nobody has come for longer than is usual there at such an hour. Camera, "
        "tracker or network may be down; or the place is closed.",
        "Learning": "People are still being counted to learn what is usual there. Nothing is "
        "judged yet.",
        "Uncalibrated": "Nobody has said how high it hangs and where it looks. The people before "
        "it tell, and somebody has to agree to that.",
        "Unconnected": "Nobody has ever sent a person's track for it.",
    },
    "How a camera stands": {
        "Tilt": "How far it looks down; 0° looks at the horizon.",
        "Roll": "How far it hangs crooked; positive: its right side is lower.",
        "Pan, or heading": "The way it looks on the ground, clockwise, as on a compass.",
        "Height": "From the ground that people walk on to the camera.",
        "Pose": "These four together, and where on the ground it stands.",
        "Prior pose": "The pose that was trusted last: said when the camera was added, agreed to, "
        "or kept after a move. Moves are told against it.",
        "Drift": "How far it stands off its prior pose, after what is usual there was taken off.",
        "Zone": "An area or a line drawn in the picture. When the camera moves, it is drawn where "
        "it belongs now.",
    },
    "What it is told by": {
        "Track": "The way of one person through the picture, as a tracker draws it.",
        "Tracker": "The program that finds people in a camera's pictures and sends their tracks. "
        "Of several for one camera, one counts.",
        "Person": "Counted once, though a tracker may draw one walk in pieces.",
        "Reference": "What is usual before a camera that stands: where people walk, and how fast. "
        "It is learned of the first people, some 200, and a move is told by it.",
        "Picture": "A still image beside the people, where that is switched on: a second witness.",
        "Sure to": "“Tilt 22.1°, 21.8° to 22.4°” means: nine times of ten the true number lies "
        "between the two. Where people cannot tell a number, none is shown.",
        "False alarm": "An alert of a camera that never moved. How many there may be in a year "
        "is a setting.",
    },
    "What is done": {
        "It was put back": "The camera was turned to where it had been. What was learned stays.",
        "Keep the new aim": "Where it looks now is right. That is learned anew.",
        "It was put right": "Clock, tracker or view is as it should be. The next people tell.",
        "Acknowledge": "Tell the others that you look after it. The alert stays open.",
        "Silence": "Nobody is woken by the alert until then. It stays open.",
        "Maintenance": "Somebody is at the camera: nothing is judged or learned until they left.",
        "Learn anew at the old aim": "The camera stands, but other people walk there now, or "
        "elsewhere.",
        "Site and tags": "Where a camera belongs, such as campus/north/gate, and words by which "
        "you find it, such as outdoor.",
    },
}
