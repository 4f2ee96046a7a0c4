"""Command line, live view and settings; the only room that knows every other one."""
