"""Offline work without a clock: replay of records and reproduction of experiments."""
