"""What the columns of a table that nobody described probably are: time, torque, rate, angle, and their units."""
