"""An attack and a detector for dcmg."""
