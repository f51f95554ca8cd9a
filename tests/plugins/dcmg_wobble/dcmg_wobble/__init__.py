"""An attack, a detector and an observer for dcmg."""
