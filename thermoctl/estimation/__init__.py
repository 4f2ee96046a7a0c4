"""What is believed about the plant, and how sure the belief is."""
