"""What a client waits for: its own time, and that of the loop where one has to answer."""

from thermoctl.services.control_client import ANSWER_S, ControlClient


class Client(ControlClient):
    """A client that notes its calls, of a daemon that gives its loops seven seconds."""

    def __init__(self):
        self.asked = []

    def ask(self, do, patience_s=ANSWER_S, **keys):
        self.asked.append((do, patience_s, keys))
        return {"patience_s": 7}


def test_a_call_that_a_loop_grants_may_take_what_the_daemon_gives_it_and_an_answer_more():
    client = Client()
    client.ask_loop("mode", loop="tank", mode="off")
    assert client.asked == [
        ("status", ANSWER_S, {}),
        ("mode", 7.0 + ANSWER_S, {"loop": "tank", "mode": "off"}),
    ]
