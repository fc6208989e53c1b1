"""What a reader of calibration files did not take, in words."""

from service.wording.language import N_, _
from surefoot.calibration.value import Calibration, Note

_NOTES = {
    Note.RECTIFICATION: N_(
        "R is the rectification of a stereo camera, not its pose, and is not taken."
    ),
    Note.STEREO_PAIR: N_(
        "R and T are between the two cameras of a stereo pair, no pose in the world, and are not "
        "taken. The lens is that of the first camera."
    ),
    Note.RIG: N_(
        "The transforms are between the sensors of a rig, no pose in the world, and are not taken."
    ),
    Note.BOARDS: N_(
        "The rotations and translations are those of the calibration boards and are not taken."
    ),
    Note.TRANSPOSED: N_("The camera matrix is transposed, as MATLAB writes it."),
    Note.COUNTED_FROM_ONE: N_("MATLAB counts pixels from 1: cx and cy are 1 less here."),
    Note.FEWER_COEFFICIENTS: N_(
        "{given:.0f} distortion coefficients were replaced by {taken:.0f}, which agree with them "
        "within {px:.2g} px."
    ),
    Note.SKEW: N_("The skew of {px:.2g} px is not taken."),
    Note.OWN_WORLD: N_(
        "The pose is in the model's own world. Use it only if the model is aligned: in metres, "
        "with Z up and the ground at Z = 0."
    ),
}


def notes_of(calibration: Calibration) -> list[str]:
    """The notes on a calibration, in the reader's language."""
    return [_(_NOTES[note], **values) for note, values in calibration.notes.items()]
