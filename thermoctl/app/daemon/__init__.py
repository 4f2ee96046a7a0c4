"""The daemon, who answers for it, and who thinks beside it."""
