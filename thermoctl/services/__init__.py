"""Consumers of finished cycles: history, state, journal. They never steer.

- What is recorded: `history` has every cycle, `journal` every event, and `events` all their names.
  Both take from a `feed` that is bounded, and write `plain` text.
- What must survive a power cut: `store` writes records whole or not at all; `latches` keeps the
  latches there and `learned` the models.
- Who may talk to the daemon: `control_socket` serves clients, each on a `control_line`, in the
  words of `control_protocol`, at a `control_place`; `control_client` is the other end.
- How it lives on the machine: `places` for its files, `lock` against a second daemon, `notify` to
  the service manager.
"""
