"""Offline work without a clock: replays, and experiments reproduced."""
