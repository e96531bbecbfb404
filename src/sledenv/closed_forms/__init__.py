"""What has a solution in closed form: the wheel, where a body rests and tips; imports simulation/."""
