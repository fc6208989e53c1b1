"""Programs of ours, run by the interpreter that runs us."""

import sys


def command_of(module: str, *words: str, options: str = "") -> list[str]:
    """The command that runs a module; `options` are more letters for the interpreter.

    By `-P` it is of the package that is installed, like us, and not of what lies in the folder that
    we were called in.
    """
    return [sys.executable, f"-{options}Pm", module, *words]
