"""The studies of the papers this program stands on, each repeated by one command."""
