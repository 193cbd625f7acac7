"""Contact of the body with itself and with rigid bodies."""
