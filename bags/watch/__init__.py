"""What a monitor does: designs and steppers of a run."""
