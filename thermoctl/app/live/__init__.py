"""The live view of a loop in a terminal: contents, drawing, keys."""

from thermoctl.app.live.desk import Desk
from thermoctl.app.live.keys import Action, Keys
from thermoctl.app.live.look import Colour, Look, look_for
from thermoctl.app.live.model import Facts, LiveModel, View
from thermoctl.app.live.render import render
from thermoctl.app.live.screen import LiveScreen

__all__ = [
    "Action",
    "Colour",
    "Desk",
    "Facts",
    "Keys",
    "LiveModel",
    "LiveScreen",
    "Look",
    "View",
    "look_for",
    "render",
]
