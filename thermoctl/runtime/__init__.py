"""The loop, its clock, its watchdog and the feed of finished cycles."""
