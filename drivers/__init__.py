"""Real devices: gyroscopes on a serial line, torque amplifiers on CAN, and the bench Rig made of them."""
